"""How the view looks, as textual's CSS."""

from __future__ import annotations

CSS = """
Screen { layout: vertical; }
#top { height: 1; }
#access { width: auto; background: $primary; color: $text; text-style: bold; }
#access.armed { background: $error; }
#status { width: 1fr; padding: 0 1; }
#latency { height: 1; }
#reply { width: auto; padding: 0 1; }
#history { width: 1fr; height: 1; }
#lost { width: auto; padding: 0 1; }
#lost.bad { color: $text-error; text-style: bold; }
#banner { height: auto; max-height: 4; padding: 0 1; color: $text-muted; }
#banner.bad { background: $error; color: $text; text-style: bold; }
#tabs { height: 1; padding: 0 1; color: $text-primary; }
#filter { display: none; height: 1; border: none; }
#panels { height: 1fr; layout: vertical; }
.panel { display: none; height: 1fr; border: none; }
.panel.chosen { display: block; }
.detail { height: auto; max-height: 4; padding: 0 1; color: $text-muted; }
DataTable { height: 1fr; scrollbar-size-horizontal: 0; }

Screen.wide #tabs { display: none; }
Screen.wide #panels { layout: grid; grid-size: 2 6; grid-columns: 1fr 1fr; grid-rows: 1fr; }
Screen.wide .panel { display: block; row-span: 2; height: 100%; border: round $primary; }
Screen.wide .panel.chosen { border: round $accent; }
Screen.wide #panel3, Screen.wide #panel4 { row-span: 3; }

ModalScreen { align: center middle; }
.dialog { width: 76; max-width: 95%; height: auto; max-height: 90%; border: round $accent; padding: 0 1;
          background: $surface; }
#refusal { color: $text-error; }
"""
