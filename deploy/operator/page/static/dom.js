/** Small helpers that touch the document only when something changes. */

const SVG = "http://www.w3.org/2000/svg";

/** @param {string} id @returns {HTMLElement} */
export const byId = (id) => document.getElementById(id);

/** Set the text of an element that holds nothing but text. */
export function setText(element, text) {
  const node = element.firstChild;
  if (node?.nodeType !== Node.TEXT_NODE) element.textContent = text;
  else if (node.data !== text) node.data = text; // creates no new node
}

/** Set attributes; `null` removes one. */
export function setAttributes(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null) element.removeAttribute(name);
    else if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
  }
}

/** Show a text in an element that is hidden while it has none. */
export function setNote(element, text) {
  setText(element, text);
  if (element.hidden === Boolean(text)) element.hidden = !text;
}

/** Create an HTML element with attributes and children. */
export function create(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  setAttributes(element, attributes);
  element.append(...children);
  return element;
}

/** Create an SVG element with attributes and append it to a parent. */
export function draw(parent, name, attributes = {}) {
  const element = document.createElementNS(SVG, name);
  setAttributes(element, attributes);
  return parent.appendChild(element);
}

/**
 * Act when a button is activated by mouse, finger, key or assistive technology.
 *
 * @param {HTMLButtonElement} button
 * @param {() => void} act
 */
export function onActivate(button, act) {
  const doIt = () => button.ariaDisabled !== "true" && act();
  button.addEventListener("click", doIt);
  // Browsers make no click of a second finger, as when the first one holds.
  button.addEventListener("pointerup", (event) => {
    const isInside = button.contains(document.elementFromPoint(event.clientX, event.clientY));
    if (!event.isPrimary && isInside) doIt();
  });
}
