"use strict";
/* Tables that can be sorted, filtered and saved. What the page says without scripting stays as it is.

   A table's blocks are its bodies; the header of the first is the table's head, that of every other its
   first row. Rows are sorted and filtered within their block. */
(() => {
  const MANY_ROWS = 15;
  const DASHES = new Set(["", "–", "-", "—"]);
  const NUMBER = /^[\s(<>≤≥~±]*([-+−]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+−]?\d+)?)/;
  const ONE = String.raw`[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?`;
  const NUMBERS_ALONE = new RegExp(`^${ONE}(?: (?:to|±) ${ONE})* ?%?$`);
  const collator = new Intl.Collator(undefined, { numeric: true });

  const text = (cell) => cell.textContent.trim();

  /* ---- what is in a table ---- */

  const isHeader = (row) => row.cells.length > 0 && [...row.cells].every((cell) => cell.scope === "col");

  const blocks = (table) =>
    [...table.tBodies].map((body) => {
      const rows = [...body.rows];
      const own = rows.length && isHeader(rows[0]) ? rows[0] : undefined;
      return { body, own, header: own ?? table.tHead.rows[0], rows: own ? rows.slice(1) : rows };
    });

  const headers = (table) => new Set(blocks(table).map((block) => block.header));

  /* ---- sorting ---- */

  /* The first number of a cell; null is no number. */
  const numberIn = (said) => {
    const found = NUMBER.exec(said);
    return found ? Number(found[1].replace(/−/g, "-")) : null;
  };

  /* Keys of a column: numbers where most cells begin with one. Cells without go last, dashes last of all. */
  const keysOf = (rows, column) => {
    const said = rows.map((row) => (row.cells[column] ? text(row.cells[column]) : ""));
    const numbers = said.map(numberIn);
    const filled = said.filter((each) => !DASHES.has(each)).length;
    const numeric = filled > 0 && numbers.filter((each) => each !== null).length * 2 >= filled;
    return said.map((each, place) => ({
      row: rows[place],
      said: each,
      value: numeric ? numbers[place] : null,
      last: DASHES.has(each) ? 2 : numeric && numbers[place] === null ? 1 : 0,
    }));
  };

  const compare = (direction) => (one, other) =>
    one.last - other.last ||
    direction * ((one.value ?? 0) - (other.value ?? 0) || collator.compare(one.said, other.said));

  const NAMES = { 1: "ascending", [-1]: "descending" };

  /* Direction 1 is ascending, -1 descending, 0 as the page was written. */
  const sort = (table, column, direction) => {
    for (const { body, rows } of blocks(table)) {
      const ordered = direction === 0
        ? rows.sort((one, other) => one.dataset.place - other.dataset.place)
        : keysOf(rows, column).sort(compare(direction)).map((key) => key.row);
      body.append(...ordered);
    }
    for (const row of headers(table)) {
      [...row.cells].forEach((cell, place) => {
        if (place === column && direction) cell.setAttribute("aria-sort", NAMES[direction]);
        else cell.removeAttribute("aria-sort");
      });
    }
  };

  const sortBy = (button) => {
    const cell = button.closest("th");
    const next = { ascending: -1, descending: 0 }[cell.getAttribute("aria-sort")] ?? 1;
    sort(cell.closest("table"), cell.cellIndex, next);
  };

  /* ---- filtering ---- */

  const filter = (table, words, told) => {
    const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0, all = 0;
    for (const { rows, own } of blocks(table)) {
      let here = 0;
      for (const row of rows) {
        row.said ??= [...row.cells].map(text).join("\n").toLowerCase();
        const hidden = !wanted.every((word) => row.said.includes(word));
        if (row.hidden !== hidden) row.hidden = hidden;
        here += !hidden;
      }
      if (own) own.hidden = here === 0;
      shown += here;
      all += rows.length;
    }
    told.textContent = wording("rows_of", {shown, all});
  };

  /* ---- saving ---- */

  /* A spreadsheet takes a cell that begins so for a formula, and a file from elsewhere must not bring one.
     Negative numbers, and spans of them, are none. */
  const guarded = (said) => (/^[=+\-@\t\r]/.test(said) && !NUMBERS_ALONE.test(said) ? `'${said}` : said);

  const field = (said) => {
    const safe = guarded(said);
    return /[",\r\n]/.test(safe) ? `"${safe.replace(/"/g, '""')}"` : safe;
  };

  /* Rows as the page shows them, RFC 4180. Of several blocks each row begins with its block's heading, the
     first cell of the block's header; a header is repeated where it says something else than the last. */
  const csvOf = (table) => {
    const every = blocks(table).filter((block) => block.rows.some((row) => !row.hidden));
    const many = every.length > 1;
    const lines = [];
    let last = "";
    for (const { header, rows } of every) {
      const [heading, ...titles] = [...header.cells].map(text);
      const head = many ? ["Block", "Row", ...titles] : [heading, ...titles];
      if (head.join("\n") !== last) lines.push(head);
      last = head.join("\n");
      for (const row of rows.filter((each) => !each.hidden)) {
        const cells = [...row.cells].map(text);
        lines.push(many ? [heading, ...cells] : cells);
      }
    }
    return lines.map((cells) => `${cells.map(field).join(",")}\r\n`).join("");
  };

  /* A name that every file system takes: letters and digits of any script, not too long, no device's. */
  const fileName = (caption) => {
    const name = caption.normalize("NFC").replace(/[^\p{L}\p{M}\p{N}._-]+/gu, "-").replace(/-{2,}/g, "-");
    const short = [...name].slice(0, 60).join("").replace(/^[-._]+|[-._]+$/g, "") || "table";
    return /^(con|prn|aux|nul|com\d|lpt\d)(\.|$)/i.test(short) ? `table-${short}` : short;
  };

  const save = (parts, name) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(parts, { type: "text/csv;charset=utf-8" }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  };

  /* Spreadsheets read a file without a byte order mark in the system's old code page, and show ± as Â±.
     Other programs may stumble over the mark, so what is ASCII anyway goes without. */
  const marked = (csv) => (/[^\x00-\x7f]/.test(csv) ? ["\ufeff", csv] : [csv]);

  const captionOf = (table) => table.caption?.querySelector(".caption")?.textContent ?? "";

  const saveTable = (table) => save(marked(csvOf(table)), `${fileName(captionOf(table))}.csv`);

  /* ---- numbers that the page carries packed ---- */

  const saveData = async (button) => {
    const packed = document.getElementById(button.dataset.download).textContent;
    const bytes = Uint8Array.from(atob(packed.trim()), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    save(marked(await new Response(stream).text()), button.dataset.name);
  };

  /* ---- the controls ---- */

  const made = (name, attributes, said = "") => {
    const one = Object.assign(document.createElement(name), attributes);
    one.append(said);
    return one;
  };

  const addFilter = (table, n_rows) => {
    const told = made("output", {}, wording("rows", {n: n_rows}));
    const box = made("input", { type: "search", placeholder: wording("filter") });
    box.setAttribute("aria-label", wording("filter_of", {table: captionOf(table)}));
    box.addEventListener("input", () => filter(table, box.value, told));
    const line = made("p", { className: "table-filter" });
    line.append(box, " ", told);
    table.closest(".scroll").before(line);
  };

  const equip = (table) => {
    if (table.dataset.equipped !== undefined) return;
    table.dataset.equipped = "";
    const every = blocks(table);
    const n_rows = every.reduce((sum, block) => sum + block.rows.length, 0);
    if (!table.caption || !n_rows) return;
    for (const { rows } of every) rows.forEach((row, place) => { row.dataset.place = place; });
    const most = Math.max(...every.map((block) => block.rows.length));
    for (const row of most > 1 ? headers(table) : []) {
      for (const cell of row.cells) {
        const button = made("button", { type: "button", className: "sort", title: wording("sort") });
        button.append(...cell.childNodes);
        cell.append(button);
      }
    }
    const said = made("span", { className: "caption" });
    said.append(...table.caption.childNodes);
    const button = made("button", { type: "button", className: "save-csv", title: wording("save") }, "CSV");
    table.caption.append(said, " ", button);
    if (n_rows > MANY_ROWS) addFilter(table, n_rows);
  };

  /* Tables that are folded away are equipped when they are unfolded: a page may have hundreds. */
  const equipOpen = (root) => {
    for (const table of root.querySelectorAll(".scroll > table")) {
      if (!table.closest("details:not([open])")) equip(table);
    }
  };

  document.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (!button) return;
    if (button.className === "sort") sortBy(button);
    else if (button.className === "save-csv") saveTable(button.closest("table"));
    else if (button.dataset.download) saveData(button);
  });
  document.addEventListener("toggle", (event) => { if (event.target.open) equipOpen(event.target); }, true);
  for (const offered of document.querySelectorAll(".downloads")) offered.hidden = !window.DecompressionStream;
  equipOpen(document);
})();
