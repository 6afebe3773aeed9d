// Small pieces of a page.

/** An element with attributes and children; `on` holds listeners, `text` its words. */
export function element(tag, { on = {}, text, ...attributes } = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  for (const [name, listener] of Object.entries(on)) made.addEventListener(name, listener);
  if (text !== undefined) made.textContent = text;
  made.append(...children.filter(Boolean));
  return made;
}

let made = 0;

/** A select with its label; options are [value, words]. */
export function choice(words, options, changed) {
  const id = `oarlock-choice-${++made}`;
  const select = element("select", { id, on: { change: () => changed(select.value) } }, ...options.map(([value, text]) => element("option", { value, text })));
  return { select, field: element("div", { class: "op-field" }, element("label", { for: id, text: words }), select) };
}

export function button(words, pressed, { label = words, ...attributes } = {}) {
  return element("button", { type: "button", "aria-label": label, title: label, text: words, on: { click: pressed }, ...attributes });
}
