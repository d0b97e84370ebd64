// Starts `runtime lsp`, previews the diagram of the text beside it, and shows the plots of a run.

import * as path from "path";
import * as vscode from "vscode";
import { LanguageClient, LanguageClientOptions, ServerOptions } from "vscode-languageclient/node";

interface Diagram {
  svg?: string;
  error?: string;
}

interface Run {
  code: number;
  cwd: string;
  messages: string;
  result: { run?: string; metrics?: Record<string, number | null> };
}

const PAUSE = 150; // ms without an edit before the diagram is drawn again

let client: LanguageClient | undefined;
const previews = new Map<string, vscode.WebviewPanel>();

export async function activate(context: vscode.ExtensionContext): Promise<void> {
  const waiting = new Map<string, NodeJS.Timeout>();
  context.subscriptions.push(
    vscode.commands.registerCommand("spikeblocks.preview", () => withText(preview)),
    vscode.commands.registerCommand("spikeblocks.runGraph", () => withText((text) => run(text))),
    vscode.commands.registerCommand("spikeblocks.restart", restart),
    vscode.workspace.onDidGrantWorkspaceTrust(restart),
    vscode.workspace.onDidChangeTextDocument((event) => {
      const uri = event.document.uri.toString();
      if (previews.has(uri)) {
        clearTimeout(waiting.get(uri));
        waiting.set(uri, setTimeout(() => draw(uri), PAUSE));
      }
    }),
  );
  await start();
}

export async function deactivate(): Promise<void> {
  await client?.stop();
}

async function start(): Promise<void> {
  const written = vscode.workspace.getConfiguration("spikeblocks").get<string[]>("command");
  const [command, ...args] = written?.length ? written : ["runtime", "lsp"];
  if (!vscode.workspace.isTrusted) {
    args.push("--no-modules");
  }
  const server: ServerOptions = { command, args };
  const options: LanguageClientOptions = {
    documentSelector: [{ language: "yaml" }],
    middleware: { executeCommand: lens },
  };
  client = new LanguageClient("spikeblocks", "spikeblocks", server, options);
  try {
    await client.start();
  } catch (error) {
    const text = `'${command}' did not start: install spikeblocks with its extra 'editor', or set spikeblocks.command`;
    void vscode.window.showErrorMessage(`${text} (${String(error)})`);
  }
}

async function restart(): Promise<void> {
  await client?.stop().catch(() => undefined);
  await start();
}

// What the lenses of the server ask for is shown here rather than in files.
async function lens(
  command: string,
  args: unknown[],
  next: (command: string, args: unknown[]) => vscode.ProviderResult<unknown>,
): Promise<unknown> {
  const text = await vscode.workspace.openTextDocument(vscode.Uri.parse(String(args[0])));
  if (command === "spikeblocks.showDiagram") {
    return preview(text);
  }
  if (command === "spikeblocks.run" || command === "spikeblocks.compare") {
    return run(text, command, args.slice(1));
  }
  return next(command, args);
}

function withText(use: (text: vscode.TextDocument) => Promise<void>): Promise<void> | undefined {
  const text = vscode.window.activeTextEditor?.document;
  return text ? use(text) : undefined;
}

function ask<T>(command: string, args: unknown[]): Promise<T> {
  if (!client) {
    return Promise.reject(new Error("the language server is not running"));
  }
  return client.sendRequest<T>("workspace/executeCommand", { command, arguments: args });
}

async function preview(text: vscode.TextDocument): Promise<void> {
  const uri = text.uri.toString();
  let panel = previews.get(uri);
  if (!panel) {
    const title = `Diagram: ${path.basename(text.uri.fsPath)}`;
    const beside = { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true };
    panel = vscode.window.createWebviewPanel("spikeblocks.diagram", title, beside, {});
    panel.onDidDispose(() => previews.delete(uri));
    previews.set(uri, panel);
  }
  panel.reveal(undefined, true);
  await draw(uri);
}

async function draw(uri: string): Promise<void> {
  const panel = previews.get(uri);
  if (!panel) {
    return;
  }
  const found = await ask<Diagram>("spikeblocks.diagram", [uri]).catch(
    (error): Diagram => ({ error: String(error) }),
  );
  if (found.svg !== undefined) {
    const image = Buffer.from(found.svg, "utf-8").toString("base64");
    panel.webview.html = page(`<img src="data:image/svg+xml;base64,${image}">`);
  } else if (!panel.webview.html.includes("<img")) {
    // While the text has problems, the last diagram stays; the problems are underlined.
    panel.webview.html = page(`<p>${escaped(found.error ?? "there is no diagram")}</p>`);
  }
}

async function run(
  text: vscode.TextDocument,
  command = "spikeblocks.run",
  args: unknown[] = [],
): Promise<void> {
  await text.save();
  const title = `Running ${path.basename(text.uri.fsPath)}`;
  const place = { location: vscode.ProgressLocation.Notification, title };
  const found = await vscode.window.withProgress(place, () =>
    ask<Run>(command, [text.uri.toString(), ...args]),
  );
  if (!found.result.run) {
    void vscode.window.showErrorMessage(found.messages || "the run failed");
    return;
  }
  await results(vscode.Uri.file(path.resolve(found.cwd, found.result.run)), found);
}

async function results(folder: vscode.Uri, found: Run): Promise<void> {
  const plots = vscode.Uri.joinPath(folder, "plots");
  const panel = vscode.window.createWebviewPanel(
    "spikeblocks.plots",
    `Run: ${path.basename(path.dirname(folder.fsPath))}`,
    { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true },
    { localResourceRoots: [plots] },
  );
  let names: string[] = [];
  try {
    names = (await vscode.workspace.fs.readDirectory(plots)).map(([name]) => name);
  } catch {
    // A graph without plots has no such folder.
  }
  const images = names
    .filter((name) => /\.(png|svg|gif)$/.test(name))
    .sort()
    .map((name) => panel.webview.asWebviewUri(vscode.Uri.joinPath(plots, name)))
    .map((uri) => `<img src="${escaped(uri.toString())}">`);
  const rows = Object.entries(found.result.metrics ?? {}).map(
    ([name, value]) => `<tr><td>${escaped(name)}</td><td>${escaped(String(value))}</td></tr>`,
  );
  const body = `<p>${escaped(folder.fsPath)}</p><table>${rows.join("")}</table>${images.join("")}`;
  panel.webview.html = page(body, panel.webview.cspSource);
}

function page(body: string, source = ""): string {
  const policy = `default-src 'none'; img-src data: ${source}; style-src 'unsafe-inline'`;
  return `<!DOCTYPE html><html><head>
<meta http-equiv="Content-Security-Policy" content="${policy}">
<style>img { max-width: 100%; background: white; display: block; margin: 1em 0 } td { padding-right: 2em }</style>
</head><body>${body}</body></html>`;
}

function escaped(text: string): string {
  return text.replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
}
