"use strict";
/* On the study's page: a link to a subject or a recording carries the names of the subjects that have such a page,
   for that page's list of subjects (switch.js). Were they written into the pages, one subject more would make all
   of them anew. */
(() => {
const groups = new Map();
for (const link of document.querySelectorAll("#subjects a[href^='report/']")) {
  const [, folder, ...rest] = link.getAttribute("href").split("/"), page = rest.join("/");
  if (!groups.has(page)) groups.set(page, {folders: new Set(), links: []});
  groups.get(page).folders.add(folder);
  groups.get(page).links.push(link);
}
for (const {folders, links} of groups.values()) {
  for (const link of links) link.hash = `subjects=${[...folders].join(",")}`;
}
})();
