#include "report/page/html.h"

namespace mvstudio::report {
namespace {

// Series colours are those of Okabe and Ito, "Color universal design", 2008, darkened or lightened for contrast with the
// ground.
constexpr char kStyle[] = R"css(
:root{--ground:#fff;--card:#f6f8fa;--ink:#1b2128;--muted:#57616d;--rule:#d8dee5;--grid:#e8ecf0;
--pass:#00694c;--pass-bg:#dcf3ea;--warn:#7a4d00;--warn-bg:#fdf0d2;--fail:#a3260b;--fail-bg:#fde4dc;--look:#fff7e0;
--c0:#0072b2;--c1:#d55e00;--c2:#009e73;--c3:#b5528c;--c4:#c98500;--c5:#3f9fd6;--c6:#6b7480;--c7:#7d5a3c;}
@media (prefers-color-scheme:dark){:root{--ground:#14181d;--card:#1d232a;--ink:#e6eaee;--muted:#a3adb8;--rule:#39424c;--grid:#2a3139;
--pass:#63d6ac;--pass-bg:#12382c;--warn:#f2c14e;--warn-bg:#3f3009;--fail:#ff9a7d;--fail-bg:#4a1c10;--look:#33290d;
--c0:#4aa8e0;--c1:#f08a3c;--c2:#3cc79c;--c3:#dd8fba;--c4:#e9b03c;--c5:#86cbf0;--c6:#98a2ad;--c7:#bf9a78;}}
@media print{:root{--ground:#fff;--card:#fff;--ink:#000;--muted:#444;--rule:#bbb;--grid:#ddd;--look:#f4f4f4;
--pass:#00694c;--pass-bg:#fff;--warn:#7a4d00;--warn-bg:#fff;--fail:#a3260b;--fail-bg:#fff;
--c0:#0072b2;--c1:#d55e00;--c2:#009e73;--c3:#b5528c;--c4:#c98500;--c5:#3f9fd6;--c6:#6b7480;--c7:#7d5a3c;}}
*{box-sizing:border-box}
body{margin:0 auto;padding:1.5rem 1.5rem 3rem;max-width:78rem;background:var(--ground);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",Arial,sans-serif}
h1{font-size:1.6rem;line-height:1.2;margin:0 0 .3rem}h2{font-size:1.25rem;margin:0 0 .5rem}
h3{font-size:1rem;margin:1.1rem 0 .4rem}
p{margin:.4rem 0 .8rem;max-width:60rem}.muted,figcaption,.unit{color:var(--muted)}.unit{font-weight:400}
header{display:flex;flex-wrap:wrap;gap:.5rem 1rem;align-items:baseline;margin-bottom:.8rem}header p,header ul{flex-basis:100%;margin:0}
h1,h3,header p,header li,.card,.fix li{overflow-wrap:anywhere}.sentence{font-weight:600}
nav{display:flex;flex-wrap:wrap;gap:.3rem 1.1rem;padding:.5rem 0;border-top:1px solid var(--rule);border-bottom:1px solid var(--rule);
margin-bottom:1.2rem;font-size:.92em}
a{color:var(--c0);text-decoration:none}a:hover,p a,li a{text-decoration:underline}
section{padding:1rem 0 .4rem;border-top:1px solid var(--rule)}section:first-child{border-top:0;padding-top:.3rem}
.badge{display:inline-block;padding:.05rem .55rem;border-radius:.7rem;font-size:.82em;font-weight:650;white-space:nowrap;
border:1px solid currentColor}
.badge.pass{color:var(--pass);background:var(--pass-bg)}.badge.warn{color:var(--warn);background:var(--warn-bg)}
.badge.fail{color:var(--fail);background:var(--fail-bg)}.badge.idle{color:var(--muted)}
.cards{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,13rem),1fr));gap:.5rem;margin:.4rem 0 .8rem}
.card{border:1px solid var(--rule);border-left:4px solid var(--muted);border-radius:.4rem;padding:.4rem .6rem;background:var(--card)}
.card.pass{border-left-color:var(--pass)}.card.warn{border-left-color:var(--warn)}.card.fail{border-left-color:var(--fail)}
.pair{display:flex;flex-wrap:wrap;gap:.2rem 1.6rem;align-items:flex-start}.pair>figure{flex:1 1 19rem}.pair>.scroll{max-width:100%}
.result{display:flex;flex-wrap:wrap;align-items:baseline;gap:0 .8rem}.result>*{flex:1 1 100%;min-width:0}
.result>h3,.result>p,.result>details:not([open]){flex:0 1 auto}.result>p{margin:.2rem 0}.result>details{margin-right:.4rem}
.card h3 .badge{align-self:flex-start}
.card h3{display:flex;flex-wrap:wrap;justify-content:space-between;gap:.5rem;margin:0 0 .35rem;font-size:.95rem}
.card dl{display:grid;grid-template-columns:minmax(0,1fr) auto;margin:0;gap:.05rem .8rem;font-size:.9em}.card dt{color:var(--muted)}
.card dd{margin:0;text-align:right;font-variant-numeric:tabular-nums;font-weight:600;white-space:nowrap}
.card p{margin:.1rem 0 0;font-size:.88em}
.worst{margin:.4rem 0 .8rem;padding-left:1.2rem}
.fix{padding-left:0;list-style:none;max-width:66rem}
.fix li{margin:.35rem 0;padding:.45rem .8rem;border-left:4px solid var(--warn);background:var(--card);border-radius:0 .3rem .3rem 0}
.fix li.fail{border-left-color:var(--fail)}.fix .hint{display:block}.fix .from{color:var(--muted);font-size:.86em}
code{font:.86em ui-monospace,"DejaVu Sans Mono",Consolas,monospace;overflow-wrap:anywhere}
.scroll{overflow-x:auto;margin:.3rem 0 .7rem}
table{border-collapse:collapse;font-size:.92em;font-variant-numeric:tabular-nums}
caption{text-align:left;white-space:nowrap;font-weight:600;padding-bottom:.35rem}
th,td{padding:.2rem .5rem;text-align:left;border-bottom:1px solid var(--rule);vertical-align:top}
thead th,thead td{border-bottom:2px solid var(--rule);vertical-align:bottom}th.num,td.num{text-align:right;white-space:nowrap}
td.long{white-space:normal;overflow-wrap:anywhere}
tr.look td{background:var(--look)}td code{white-space:pre-wrap}
figure{margin:.3rem 0 .8rem;min-width:0;overflow-wrap:anywhere}figcaption{font-size:.86em;margin-top:.3rem;max-width:60rem}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,31rem),1fr));gap:.4rem 1.6rem;align-items:start}
.grid.three{grid-template-columns:repeat(auto-fill,minmax(min(100%,22.5rem),1fr))}
.grid.small{grid-template-columns:repeat(auto-fill,minmax(min(100%,17.5rem),1fr))}
.grid.images{grid-template-columns:repeat(auto-fill,minmax(min(44%,17.5rem),1fr))}
.grid.methods{grid-template-columns:repeat(auto-fill,minmax(min(30%,9rem),1fr));gap:.4rem .6rem}.grid.methods img{width:100%}
details{display:inline-block;vertical-align:top;margin:.2rem 1.4rem .5rem 0}details[open]{display:block;margin:.3rem 0 1rem}summary{cursor:pointer;color:var(--c0)}
video{max-width:100%;max-height:40rem;display:block}
img{max-width:100%;height:auto;display:block;border:1px solid var(--rule);background:#888}
.strip img{width:100%}.strip .legend{display:grid;grid-auto-flow:column;grid-auto-columns:1fr;text-align:center;
font-size:.72em;color:var(--muted);overflow-wrap:normal}
.compared{position:relative;max-width:19rem;overflow:hidden;border:1px solid var(--rule)}
.compared div{position:absolute;inset:0;overflow:hidden}.compared img{position:absolute;max-width:none;border:0}
.compared+input{width:100%;max-width:19rem;display:block;margin:.3rem 0 .6rem}
@media print{.compared,.compared+input{display:none}}
.player canvas{width:min(100%,48rem);height:30rem;display:block;background:#000;touch-action:none;cursor:grab}
.player input{width:min(60%,24rem);vertical-align:middle}
.studio .stage{position:relative;height:min(32rem,66vh);border:1px solid var(--rule);border-radius:.3rem;background:var(--card);overflow:hidden}
.studio canvas{display:block}.stage canvas{width:100%;height:100%;touch-action:none;cursor:grab}
.studio .stage canvas:focus-visible,.studio .timeline:focus-visible{outline:2px solid var(--c0);outline-offset:-2px}
.studio .names{position:absolute;inset:0;pointer-events:none;overflow:hidden;font-size:.78em;color:var(--muted)}
.studio .names span{position:absolute;left:.4rem;top:-.7rem;white-space:nowrap;text-shadow:0 0 3px var(--card),0 0 3px var(--card)}
.studio .names .chosen{color:var(--c1);font-weight:650}
.studio aside{position:absolute;right:.5rem;top:.5rem;width:17rem;max-width:calc(100% - 1rem);max-height:calc(100% - 1rem);overflow:auto;
padding:.5rem .7rem;border:1px solid var(--rule);border-radius:.3rem;background:var(--ground);font-size:.86em;overflow-wrap:anywhere}
.studio aside h3{margin:0 0 .3rem}.studio aside img{max-height:10rem;width:auto;margin-bottom:.3rem}
.studio dl{display:grid;grid-template-columns:auto minmax(0,1fr);gap:.05rem .7rem;margin:0 0 .4rem}.studio dt{color:var(--muted)}
.studio dd{margin:0;text-align:right;font-variant-numeric:tabular-nums}.studio .note{margin:.2rem 0;border-left:3px solid var(--warn);padding-left:.5rem}
.studio .bar{display:flex;flex-wrap:wrap;gap:.3rem .8rem;align-items:center;margin:.5rem 0}.studio .bar[hidden]{display:none}
.studio .bar>input{flex:1 1 12rem;min-width:0}.studio output{min-width:6.5rem;font-variant-numeric:tabular-nums}.studio label[hidden]{display:none}
.studio label input{vertical-align:middle}.studio label input[type=range]{width:6rem}
.studio select,.studio button{font:inherit;max-width:14rem}
.studio .timeline{position:relative;height:1.9rem;border:1px solid var(--rule);cursor:pointer}
.studio .timeline canvas{width:100%;height:100%;image-rendering:pixelated}
.studio .timeline i{position:absolute;top:-3px;bottom:-3px;width:2px;margin-left:-1px;background:var(--ink);pointer-events:none}
@media (max-width:40rem){.studio .stage{height:min(26rem,60vh)}.studio .names{font-size:.7em}
.studio aside{left:.5rem;right:.5rem;top:auto;bottom:.5rem;width:auto;max-height:45%}.studio aside img{display:none}}
svg{max-width:100%;height:auto;display:block}
svg text{fill:var(--ink);font:12px system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",Arial,sans-serif}
svg text.t{font-weight:600;font-size:13px}svg text.m{fill:var(--muted)}svg text.x{font-size:10.5px}
svg .axis{stroke:var(--muted);fill:none}svg .gridline{stroke:var(--grid);fill:none}
svg .frame{fill:var(--card);stroke:var(--rule)}
svg .ref{stroke:var(--ink);stroke-dasharray:4 3;fill:none}svg .halo{paint-order:stroke;stroke:var(--ground);stroke-width:3px}
svg .err{stroke:var(--ink);fill:none}svg .ink{fill:var(--ink);stroke:none}
.s0{stroke:var(--c0);fill:none}.s1{stroke:var(--c1);fill:none}.s2{stroke:var(--c2);fill:none}.s3{stroke:var(--c3);fill:none}
.s4{stroke:var(--c4);fill:none}.s5{stroke:var(--c5);fill:none}.s6{stroke:var(--c6);fill:none}.s7{stroke:var(--c7);fill:none}
.f0{fill:var(--c0)}.f1{fill:var(--c1)}.f2{fill:var(--c2)}.f3{fill:var(--c3)}.f4{fill:var(--c4)}.f5{fill:var(--c5)}
.f6{fill:var(--c6)}
.f7{fill:var(--c7)}.h0,.h1,.h2,.h3,.h4{fill:var(--c0)}.h0{fill-opacity:.08}.h1{fill-opacity:.25}.h2{fill-opacity:.45}.h3{fill-opacity:.65}
.h4{fill-opacity:.9}
svg .over-edge{stroke:#000;stroke-opacity:.55;fill:none}svg .over-ring{stroke:#ffd23f;fill:none}
svg .over-needle{stroke:#ff5c3b;fill:none}svg .over-cross{stroke:#ff4fd8;fill:none}svg .over-bone{stroke:#46c8ff;fill:none}
.soft{fill-opacity:.16}.dots{stroke-linecap:round}.faint{opacity:.45}
footer{margin-top:2rem;padding-top:.6rem;border-top:1px solid var(--rule);color:var(--muted);font-size:.86em}
@media print{nav,#studio{display:none}body{font-size:10pt;max-width:none;padding:0}
figure,tr,.card,.fix li{break-inside:avoid}h2,h3{break-after:avoid}}
)css";

}  // namespace

std::string_view PageStyle() { return kStyle; }

}  // namespace mvstudio::report
