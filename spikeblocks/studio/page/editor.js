// The editor: CodeMirror with the problems, offers and cards of the language service.
import {
  Annotation, EditorState, EditorView, HighlightStyle, autocompletion, bracketMatching, closeBrackets,
  completionKeymap, defaultKeymap, drawSelection, highlightActiveLine, highlightSelectionMatches,
  history, historyKeymap, hoverTooltip, indentUnit, indentWithTab, keymap, lineNumbers, lintGutter,
  lintKeymap, searchKeymap, setDiagnostics, syntaxHighlighting, tags, yaml,
} from "./codemirror.js";

const outside = Annotation.define();  // marks what did not come from the keyboard

// The server counts characters, the editor UTF-16 units.
const isPlain = (text) => !/[\ud800-\udfff]/.test(text);
export const toUnits = (text, at) => (isPlain(text) ? at : [...text].slice(0, at).join("").length);
export const toPoints = (text, at) => (isPlain(text) ? at : [...text.slice(0, at)].length);

const colours = HighlightStyle.define([
  {tag: [tags.propertyName, tags.definition(tags.propertyName)], color: "var(--key)"},
  {tag: [tags.number, tags.bool, tags.null], color: "var(--number)"},
  {tag: tags.string, color: "var(--string)"},
  {tag: [tags.comment, tags.lineComment], color: "var(--comment)"},
]);
const theme = EditorView.theme({
  "&": {color: "var(--ink)", backgroundColor: "var(--back)"},
  ".cm-content, .cm-gutters": {fontFamily: "var(--mono)"},
  ".cm-gutters": {backgroundColor: "var(--faint)", color: "var(--soft)", border: "0"},
  ".cm-activeLine, .cm-activeLineGutter": {backgroundColor: "color-mix(in srgb, var(--accent) 8%, transparent)"},
  "&.cm-focused .cm-cursor": {borderLeftColor: "var(--ink)"},
  ".cm-selectionBackground, &.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground":
    {backgroundColor: "color-mix(in srgb, var(--accent) 28%, transparent)"},
  ".cm-tooltip": {backgroundColor: "var(--faint)", border: "1px solid var(--line)", color: "var(--ink)",
    maxWidth: "34rem"},
  ".cm-tooltip-autocomplete ul li[aria-selected]": {background: "var(--accent)", color: "var(--back)"},
  ".card": {padding: ".4rem .6rem", whiteSpace: "pre-wrap", fontSize: ".8125rem"},
  ".cm-completionDetail": {color: "var(--soft)"},
  ".cm-panels": {backgroundColor: "var(--faint)", color: "var(--ink)"},
});

/** An editor in an element; `on` has changed(text), moved(offset), ask(what, offset). */
export function makeEditor(parent, nonce, on) {
  const complete = async (context) => {
    const text = context.state.doc.toString();
    const found = await on.ask("complete", toPoints(text, context.pos));
    if (!found || !found.offers.length) return null;
    const from = toUnits(text, found.from), to = toUnits(text, found.to);
    return {from, to, filter: true, options: found.offers.map((offer) => ({
      label: offer.label, detail: offer.detail, info: offer.doc || undefined, boost: -offer.rank,
      apply: offer.snippet ? offer.insert.replace(/\$\{\d+\|([^,|}]*)[^}]*\}|\$\{\d+:([^}]*)\}|\$\d+/g,
        (all, choice, hint) => choice ?? hint ?? "") : offer.insert,
    }))};
  };
  const card = hoverTooltip(async (view, position) => {
    const text = view.state.doc.toString();
    const found = await on.ask("hover", toPoints(text, position));
    if (!found) return null;
    return {pos: toUnits(text, found.from), end: toUnits(text, found.to), create: () => {
      const dom = document.createElement("div");
      dom.className = "card";
      dom.textContent = found.text.replace(/[*`]/g, "");
      return {dom};
    }};
  });
  const view = new EditorView({parent, state: EditorState.create({extensions: [
    EditorView.cspNonce.of(nonce), lineNumbers(), history(), drawSelection(), bracketMatching(),
    closeBrackets(), highlightActiveLine(), highlightSelectionMatches(), indentUnit.of("  "), yaml(),
    syntaxHighlighting(colours), theme, lintGutter(), card,
    autocompletion({override: [complete]}),
    keymap.of([...completionKeymap, ...lintKeymap, ...searchKeymap, ...historyKeymap, ...defaultKeymap, indentWithTab]),
    EditorView.contentAttributes.of({"aria-label": "Text of the graph"}),
    EditorView.updateListener.of((update) => {
      if (update.docChanged && !update.transactions.some((each) => each.annotation(outside))) {
        on.changed(update.state.doc.toString());
      }
      if (update.selectionSet && !update.docChanged && view.hasFocus) {
        const text = update.state.doc.toString();
        on.moved(toPoints(text, update.state.selection.main.head));
      }
    }),
  ]})});
  const text = () => view.state.doc.toString();
  return {
    text,
    /** Take another text as one step of undo; what is the same stays where it is. */
    set(next) {
      const now = text();
      if (now === next) return;
      let start = 0, end = now.length, last = next.length;
      while (start < end && start < last && now[start] === next[start]) start++;
      while (end > start && last > start && now[end - 1] === next[last - 1]) { end--; last--; }
      view.dispatch({changes: {from: start, to: end, insert: next.slice(start, last)},
        annotations: outside.of(true), scrollIntoView: false});
    },
    /** Make edits of a suggestion, as if they had been typed. */
    edit(edits) {
      const now = text();
      view.dispatch({changes: edits.map(([from, to, insert]) =>
        ({from: toUnits(now, from), to: toUnits(now, to), insert}))});
    },
    mark(problems) {
      const now = text(), size = now.length;
      view.dispatch(setDiagnostics(view.state, problems.map((each) => ({
        from: Math.min(size, toUnits(now, each.from)), to: Math.min(size, Math.max(toUnits(now, each.to), toUnits(now, each.from))),
        severity: each.severity === "error" ? "error" : "warning", message: each.text,
      }))));
    },
    select(from, to, focus = false) {
      const now = text();
      view.dispatch({selection: {anchor: toUnits(now, from), head: toUnits(now, to)}, effects:
        EditorView.scrollIntoView(toUnits(now, from), {y: "center"})});
      if (focus) view.focus();
    },
    focus: () => view.focus(),
  };
}
