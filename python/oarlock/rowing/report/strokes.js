// A stroke's number in the table leads to the player, which then goes round and round that stroke.
(function () {
  "use strict";

  document.addEventListener("click", function (event) {
    var link = event.target.closest && event.target.closest("a[data-stroke]");
    var players = (window.oarlock && window.oarlock.players) || [];
    if (!link || !players.length) return;
    var player = players[0];
    var spans = player.scene.spans.filter(function (span) { return span.label === link.dataset.stroke; });
    if (!spans.length) return;
    player.setLoop(spans[0]);
    player.seek(spans[0].start_s);
  });

  // A second piece is drawn over the first one at once: its stroke of middle length, in phase with each stroke.
  function lay() {
    var player = ((window.oarlock && window.oarlock.players) || [])[0];
    var spans = (player && player.scene.ghost && player.scene.ghost.spans) || [];
    if (!spans.length || !player.scene.spans.length) return;
    var length = function (k) { return spans[k].end_s - spans[k].start_s; };
    var order = spans.map(function (_, k) { return k; }).sort(function (a, b) { return length(a) - length(b); });
    player.setGhost({ of: "other", span: order[order.length >> 1] }, "phase");
    player.seek(player.scene.spans[0].start_s);
  }
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", lay);
  else lay();

  // What is folded away belongs on paper too.
  addEventListener("beforeprint", function () {
    document.querySelectorAll("main details").forEach(function (part) { part.open = true; });
  });
})();
