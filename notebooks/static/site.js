// Names and keys that readers without a mouse or a screen need, and that the theme leaves out.
document.addEventListener("DOMContentLoaded", () => {
  for (const caption of document.querySelectorAll('.caption[role="heading"]')) caption.setAttribute("aria-level", "2");
  const drawers = { ".sidebar-drawer": "site navigation", ".toc-drawer": "contents of this page" };
  for (const [drawer, name] of Object.entries(drawers)) document.querySelector(drawer)?.setAttribute("aria-label", name);
  // Parts that scroll sideways also scroll with the arrow keys.
  for (const part of document.querySelectorAll("pre, .table-wrapper, .cell_output, .cell_output .output, math"))
    if (part.scrollWidth > part.clientWidth) part.tabIndex = 0;
});
