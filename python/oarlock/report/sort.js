// Tables of class "sortable": a click or Enter on a head sorts the rows; a second one turns the order around.
(function () {
  "use strict";

  function valueOf(row, column) {
    var cell = row.cells[column];
    var data = cell.querySelector("data");
    var text = (data ? data.getAttribute("value") : cell.textContent).trim();
    var plain = text.replace(/\u2212/g, "-").replace(/,/g, "");
    return plain !== "" && isFinite(Number(plain)) ? Number(plain) : text;
  }

  function unknown(value) {
    return value === "" || value === "\u2013" || value === "nan";
  }

  function compare(a, b) {
    if (unknown(a) || unknown(b)) return null;
    if (typeof a === "number" && typeof b === "number") return a - b;
    return String(a).localeCompare(String(b));
  }

  function sort(table, head, column) {
    var upward = head.getAttribute("aria-sort") !== "ascending";
    var body = table.tBodies[0];
    var rows = Array.prototype.map.call(body.rows, function (row, place) {
      return { row: row, place: place, value: valueOf(row, column) };
    });
    rows.sort(function (a, b) {
      var order = compare(a.value, b.value);
      if (order === null) return unknown(a.value) - unknown(b.value) || a.place - b.place;
      return (upward ? order : -order) || a.place - b.place;
    });
    rows.forEach(function (item) { body.appendChild(item.row); });
    Array.prototype.forEach.call(head.parentNode.cells, function (cell) { cell.removeAttribute("aria-sort"); });
    head.setAttribute("aria-sort", upward ? "ascending" : "descending");
  }

  function arm(table) {
    Array.prototype.forEach.call(table.tHead.rows[0].cells, function (head, column) {
      var button = document.createElement("button");
      button.type = "button";
      while (head.firstChild) button.appendChild(head.firstChild);
      if (head.title) button.title = head.title;
      button.addEventListener("click", function () { sort(table, head, column); });
      head.appendChild(button);
    });
  }

  Array.prototype.forEach.call(document.querySelectorAll("table.sortable"), arm);
})();
