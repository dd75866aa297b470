"use strict";
/* Shows one of the consecutive sections of compared models at a time, as the reader chooses. */
(() => {
  for (const choice of document.querySelectorAll(".models-choice")) {
    const select = choice.querySelector("select");
    const sections = [...select.options].map((option) => document.getElementById(option.value));
    if (sections.length < 2) continue;
    const show = () => sections.forEach((section) => { section.hidden = section.id !== select.value; });
    const follow = () => {
      const aim = document.getElementById(decodeURIComponent(location.hash.slice(1)));
      const holder = aim && sections.find((section) => section.contains(aim));
      if (!holder) return;
      select.value = holder.id;
      show();
      aim.scrollIntoView();
    };
    choice.hidden = false;
    select.addEventListener("change", show);
    addEventListener("hashchange", follow);
    show();
    follow();
  }
})();
