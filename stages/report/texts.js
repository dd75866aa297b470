"use strict";
/* What scripts say, in the page's language: JSON by name, values in its placeholders. */
const TEXTS = JSON.parse(document.getElementById("texts").textContent);
const wording = (name, values = {}) => TEXTS[name].replace(/\{(\w+)\}/g, (whole, key) => values[key] ?? whole);
