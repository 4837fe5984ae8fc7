"""The style sheet of every HTML page: one column of text, hairlines, light or dark."""

CSS = """
:root {
  color-scheme: light dark;
  --ground: #fdfdfb; --card: #ffffff; --ink: #1c1d20; --soft: #5d6066; --line: #d8d8d2;
  --accent: #0a5a94; --code: #f2f2ed; --ok: #11693f; --ok-ground: #e2f2e8;
  --failed: #a3231f; --failed-ground: #fae4e2;
  --serif: Charter, "Bitstream Charter", "Iowan Old Style", "Palatino Linotype", Palatino,
    "Source Serif 4", Cambria, Georgia, "TeX Gyre Pagella", "DejaVu Serif", serif;
  --sans: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, "DejaVu Sans",
    sans-serif;
  --mono: ui-monospace, "SF Mono", Menlo, Consolas, "DejaVu Sans Mono", monospace;
}
@media (prefers-color-scheme: dark) {
  :root {
    --ground: #15171a; --ink: #e4e4df; --soft: #a0a3a8; --line: #363a40; --accent: #7fbdec;
    --code: #20242a; --ok: #7fd3a5; --ok-ground: #16331f; --failed: #f19c96;
    --failed-ground: #40201e;
  }
}
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; scroll-behavior: smooth; }
body {
  margin: 0; background: var(--ground); color: var(--ink);
  font: 17px/1.6 var(--serif); font-variant-numeric: oldstyle-nums; hyphens: manual;
}
main { max-width: 52rem; margin: 0 auto; padding: 3.5rem 1.25rem 5rem; }
header { border-bottom: 1px solid var(--line); padding-bottom: 1.4rem; margin-bottom: 1.6rem; }
h1 { font-size: 2.15rem; line-height: 1.18; margin: 0; font-weight: 600; letter-spacing: -.01em;
  text-wrap: balance; }
.subtitle { margin: .6rem 0 0; color: var(--soft); font-size: 1.08rem; font-style: italic; }
h2 { font-size: 1.45rem; line-height: 1.25; margin: 3rem 0 .7rem; padding-top: .9rem;
  border-top: 1px solid var(--line); font-weight: 600; text-wrap: balance; }
h3 { font-size: 1.13rem; line-height: 1.3; margin: 2rem 0 .5rem; font-weight: 600; }
h2, h3 { scroll-margin-top: .5rem; break-after: avoid; }
h2 a.here, h3 a.here { color: var(--soft); text-decoration: none; opacity: 0; padding-left: .4em; }
h2:hover a.here, h3:hover a.here, a.here:focus { opacity: 1; }
p { margin: .75rem 0; max-width: 44rem; }
a { color: var(--accent); text-underline-offset: .15em; text-decoration-thickness: 1px; }
code { font: .84em var(--mono); background: var(--code); padding: .1em .32em; border-radius: 3px;
  overflow-wrap: anywhere; }
pre { background: var(--code); padding: .8rem 1rem; border-radius: 5px; overflow-x: auto;
  font: .8rem/1.5 var(--mono); }
pre code { font: inherit; padding: 0; background: none; overflow-wrap: normal; }
nav { font: .92rem/1.5 var(--sans); margin: 0 0 2rem; }
nav ol { list-style: none; margin: 0; padding: 0; columns: 17rem; column-gap: 2rem; }
nav li { break-inside: avoid; padding: .1rem 0; }
nav ol ol { columns: auto; padding-left: 1rem; font-size: .94em; }
nav a { text-decoration: none; }
nav a:hover { text-decoration: underline; }
.equation { display: flex; align-items: baseline; margin: 1.1rem 0; overflow-x: auto; }
.equation span:first-child { flex: 1; text-align: center; font-style: italic; font-size: 1.08rem;
  white-space: pre-wrap; font-variant-numeric: lining-nums; }
.equation .number { color: var(--soft); padding-left: 1rem; }
.scroll { overflow-x: auto; margin: 1.1rem 0; }
table { border-collapse: collapse; font: .84rem/1.4 var(--sans);
  font-variant-numeric: tabular-nums lining-nums; border-top: 2px solid var(--ink);
  border-bottom: 2px solid var(--ink); min-width: 40%; }
caption { max-width: calc(100vw - 2.5rem); caption-side: top; text-align: left;
  font: .95rem/1.45 var(--serif); color: var(--soft);
  padding-bottom: .5rem; }
th, td { text-align: left; padding: .3rem .9rem .3rem 0; vertical-align: baseline; }
th:last-child, td:last-child { padding-right: 0; }
thead th { border-bottom: 1px solid var(--ink); font-weight: 600; vertical-align: bottom; }
tbody tr + tr td { border-top: 1px solid var(--line); }
td.number, th.number { text-align: right; white-space: nowrap; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.2rem; margin: 1.1rem 0;
  font: .88rem/1.45 var(--sans); }
dt { color: var(--soft); }
dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 1.5rem 0; break-inside: avoid; }
figure .card { background: #ffffff; border: 1px solid var(--line); border-radius: 6px;
  padding: .7rem; overflow-x: auto; }
figure img { display: block; max-width: 100%; height: auto; margin: 0 auto; }
figcaption { font-size: .94rem; line-height: 1.45; color: var(--soft); margin-top: .5rem; }
.row { display: grid; gap: 1.2rem; width: min(92vw, 78rem); margin: 1.5rem 0 1.5rem 50%;
  transform: translateX(-50%);
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 28rem), 1fr)); }
.row figure { margin: .4rem 0; }
ul.checks { list-style: none; padding: 0; margin: 1.1rem 0; font: .88rem/1.45 var(--sans);
  border-top: 1px solid var(--line); font-variant-numeric: tabular-nums lining-nums; }
ul.checks li { display: grid; grid-template-columns: 4.4rem 1fr auto; gap: .2rem .8rem;
  align-items: baseline; padding: .32rem 0; border-bottom: 1px solid var(--line); }
ul.checks .detail { color: var(--soft); text-align: right; }
.groups { columns: 2 22rem; column-gap: 2.2rem; margin: 1.1rem 0;
  width: min(92vw, 68rem); margin-left: 50%; transform: translateX(-50%); }
.groups table { width: 100%; margin: 0 0 1.2rem; font-size: .8rem; break-inside: avoid;
  border-top: 0; border-bottom: 1px solid var(--line); }
.groups caption { font: 600 .84rem/1.35 var(--sans); color: var(--ink); padding-bottom: .25rem;
  border-bottom: 1px solid var(--ink); font-variant-numeric: lining-nums; }
.groups caption span { font-weight: 400; color: var(--soft); white-space: nowrap;
  padding-left: .5rem; }
.groups td { padding: .2rem .7rem .2rem 0; overflow-wrap: anywhere; }
.groups td:first-child { width: 4rem; white-space: nowrap; }
.groups.one { columns: 1; width: auto; margin-left: 0; transform: none; }
.groups td.number { width: 1%; }
td.soft { color: var(--soft); }
.badge { font: 600 .72rem/1 var(--sans); letter-spacing: .04em; text-align: center;
  padding: .32em .5em; border-radius: 3px; }
.badge.ok { color: var(--ok); background: var(--ok-ground); }
.badge.failed { color: var(--failed); background: var(--failed-ground); }
details { margin: 1.1rem 0; }
summary { cursor: pointer; font: .92rem var(--sans); color: var(--accent); }
footer { margin-top: 4rem; padding-top: .8rem; border-top: 1px solid var(--line);
  color: var(--soft); font: .82rem/1.5 var(--sans); }
@media (max-width: 36rem) {
  body { font-size: 16px; }
  main { padding-top: 1.8rem; }
  h1 { font-size: 1.65rem; }
  dl { grid-template-columns: 1fr; gap: 0; }
  dd { margin-bottom: .4rem; }
  .scroll td { white-space: nowrap; }
  ul.checks li { grid-template-columns: 4.4rem 1fr; }
  ul.checks .detail { grid-column: 2; text-align: left; }
}
@media print {
  :root { --ground: #ffffff; --ink: #000000; --soft: #444444; --line: #bbbbbb; --accent: #000000;
    --code: #f4f4f4; --ok: #11693f; --ok-ground: #ffffff; --failed: #a3231f;
    --failed-ground: #ffffff; }
  body { font-size: 10pt; }
  main { max-width: none; padding: 0; }
  .row { width: auto; margin: 1.5rem 0; transform: none; grid-template-columns: 1fr 1fr; }
  .scroll, pre, figure .card { overflow: visible; }
  pre { white-space: pre-wrap; }
  .badge { border: 1px solid currentColor; }
  a { text-decoration: none; }
}
"""
