// Screen readers ask a dialog for its name; the theme gives that of the search to its field alone.
const search = document.querySelector("[role=dialog].md-search");
search?.setAttribute("aria-label", search.querySelector("input").getAttribute("aria-label"));
