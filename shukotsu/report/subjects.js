"use strict";
/* From subject to subject. On the study's page a link to a subject or a recording carries the folders of the subjects
   that have such a page; were they written into the pages, one subject more would make all of them anew. On the page
   that is reached so, [data-switch] (how many folders up the subject's is) links to the subject before and after. */
(() => {
const groups = new Map();
for (const link of document.querySelectorAll("#subjects a[href^='report/']")) {
  const [, folder, ...rest] = link.getAttribute("href").split("/"), page = rest.join("/");
  groups.set(page, [...(groups.get(page) ?? []), {folder, link}]);
}
for (const pages of groups.values()) {
  const folders = [...new Set(pages.map(({folder}) => folder))].join(",");
  for (const {link} of pages) link.hash = `subjects=${folders}`;
}
const nav = document.querySelector("[data-switch]"), listed = /^#subjects=([\w%.~,-]+)$/.exec(location.hash);
if (!nav || !listed) return;
const up = Number(nav.dataset.switch), parts = location.pathname.split("/");
const folders = listed[1].split(",").filter((folder) => /^sub-[\w%.~-]+$/.test(folder));
const at = folders.indexOf(parts.at(-1 - up));
for (const [rel, folder] of at < 0 ? [] : [["prev", folders[at - 1]], ["next", folders[at + 1]]]) {
  if (folder === undefined) continue;
  const link = nav.querySelector(`[rel=${rel}]`);
  link.href = `${"../".repeat(up)}${folder}/${parts.slice(-up).join("/")}${location.hash}`;
  link.hidden = nav.hidden = false;
}
})();
