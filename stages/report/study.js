/* The hand on the study's page plays by itself while it is in view, its joints coloured by verdict. */
document.addEventListener("viewerready", ({target}) => {
  const colour = target.querySelector("[data-part=colour]");
  colour.value = "verdict";
  colour.dispatchEvent(new Event("change", {bubbles: true}));
  if (matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  let paused = false; // because it left the view, and by nobody's hand
  new IntersectionObserver(([{isIntersecting}]) => {
    if (isIntersecting && (paused || !target.viewer.index)) target.viewer.play();
    else if (!isIntersecting) {
      paused = target.viewer.playing;
      target.viewer.pause();
    }
  }).observe(target);
});
