"use strict";
/* The list of subjects of a page that was reached from the study's page (subject_lists.js): the same page of each.
   The form's data-switch says how many folders up the subject's own is. An arrow key that only looks through the list
   must not open a page: Enter does. */
(() => {
const form = document.querySelector("[data-switch]"), listed = /^#subjects=([\w%.~,-]+)$/.exec(location.hash);
if (!form || !listed) return;
const up = Number(form.dataset.switch), parts = location.pathname.split("/");
const here = parts.at(-1 - up), page = parts.slice(-up).join("/");
const folders = listed[1].split(",").filter((folder) => /^sub-[\w%.~-]+$/.test(folder));
const at = folders.indexOf(here);
if (at < 0 || folders.length < 2) return;

const address = (folder) => `${"../".repeat(up)}${folder}/${page}${location.hash}`;
const name = (folder) => decodeURIComponent(decodeURIComponent(folder)).slice("sub-".length);
const select = form.querySelector("select");
for (const folder of folders) select.add(new Option(name(folder), address(folder)));
select.selectedIndex = at;
for (const [rel, folder] of [["prev", folders[at - 1]], ["next", folders[at + 1]]]) {
  const link = form.querySelector(`[rel=${rel}]`);
  link.hidden = folder === undefined;
  if (folder !== undefined) link.href = address(folder);
}

let looking = false;
const go = () => {
  if (select.selectedIndex !== at) location.href = select.value;
};
form.hidden = false;
form.addEventListener("submit", (event) => event.preventDefault());
select.addEventListener("keydown", (event) => {
  looking = event.key !== "Enter";
  if (!looking) go();
});
select.addEventListener("pointerdown", () => (looking = false));
select.addEventListener("change", () => looking || go());
window.addEventListener("pageshow", () => (select.selectedIndex = at));
})();
