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

  // What is folded away belongs on paper too.
  addEventListener("beforeprint", function () {
    document.querySelectorAll("main details").forEach(function (part) { part.open = true; });
  });
})();
