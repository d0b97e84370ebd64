// A button that copies each block of code, and the filter of the gallery.
document.addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll("div.highlight")) {
    const button = document.createElement("button");
    button.className = "copy";
    button.type = "button";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      const text = block.querySelector("pre").innerText;
      // Of a console only the commands.
      const typed = text.split("\n").filter((line) => line.startsWith("$ "));
      await navigator.clipboard.writeText(typed.length ? typed.map((line) => line.slice(2)).join("\n") : text);
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
    block.append(button);
    // A long graph scrolls in its frame, by keyboard as well.
    const code = block.querySelector("pre");
    if (code.scrollHeight > code.clientHeight || code.scrollWidth > code.clientWidth) code.tabIndex = 0;
  }
  // A table that is wider than the page scrolls, by keyboard as well.
  for (const frame of document.querySelectorAll(".table-wrapper")) {
    frame.tabIndex = 0;
    frame.setAttribute("role", "group");
    frame.setAttribute("aria-label", frame.querySelector("caption")?.textContent ?? "table");
  }
  const filter = document.querySelector("#filter");
  if (!filter) return;
  const show = () => {
    const words = filter.value.toLowerCase().split(/\s+/);
    let shown = 0;
    for (const card of document.querySelectorAll(".card")) {
      card.hidden = !words.every((word) => card.dataset.words.includes(word));
      shown += !card.hidden;
    }
    for (const section of document.querySelectorAll("section section")) {
      section.hidden = !section.querySelector(".card:not([hidden])");
    }
    document.querySelector("#nothing").hidden = shown > 0;
  };
  filter.addEventListener("input", show);
  show();
});
