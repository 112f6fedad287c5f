"""The style of all pages: light and dark, phone width, A4 with a header on each page."""

PICTURES = """\
svg{width:100%;height:auto;font-family:inherit}text{fill:var(--ink)}
.box{fill:var(--back);stroke:var(--soft);stroke-width:1.5}.box.main{fill:var(--main);
stroke:var(--c0);stroke-width:3}.box.sub{fill:var(--sub);stroke:var(--amber)}
.bus{stroke:var(--soft);stroke-width:5}.arc{fill:none;stroke-width:2.5}
.name{font-size:15px;font-weight:600}.small{font-size:11.5px;fill:var(--soft)}
.label{font-size:12px;font-weight:600}.under{fill:var(--back)}
.tiny{font-size:10.5px;fill:var(--soft)}.sm{fill:var(--sm);stroke:var(--soft)}
.tick{stroke:var(--back);stroke-width:.8}.moment{stroke:var(--ink);stroke-width:2}
svg.window{max-height:46px}
"""
"""Style of the drawings alone."""

_COLOURS = """\
:root{color-scheme:light dark;--ink:#1f2328;--back:#fff;--soft:#57606a;--line:#d0d7de;
--head:#f3f5f7;--red:#a40e26;--amber:#7d4e00;--blue:#0550ae;--main:#ddf4ff;
--sub:#fff8c5;--sm:#eaeef2;--c0:#0550ae;--c1:#953800;--c2:#116329;--c3:#6639ba;--c4:#99286e;
--c5:#424a53}
@media screen and (prefers-color-scheme:dark){:root{--ink:#e6edf3;--back:#0d1117;--soft:#9198a1;
--line:#3d444d;--head:#161b22;--red:#ff8182;--amber:#e3b341;--blue:#79c0ff;
--main:#0c2d6b;--sub:#3d2e00;--sm:#21262d;--c0:#79c0ff;--c1:#ffa657;--c2:#7ee787;--c3:#d2a8ff;
--c4:#ff9bce;--c5:#b1bac4}}
"""

STYLE = (
    PICTURES
    + _COLOURS
    + """\
*{box-sizing:border-box}
body{font:15px/1.5 system-ui,-apple-system,"Segoe UI","Liberation Sans",sans-serif;
color:var(--ink);background:var(--back);max-width:1080px;margin:0 auto;padding:1.2em 1em 4em}
h1{margin:.2em 0 0;font-size:1.9em;line-height:1.2}
h2{margin:2.4em 0 .6em;padding-bottom:.25em;border-bottom:2px solid var(--ink);font-size:1.35em}
h3,.first h2{margin:1.5em 0 .4em;font-size:1.05em}.first h2{border:0;padding:0}
h2 .no{display:inline-block;min-width:1.5em;color:var(--soft)}
.logo{float:right;max-width:15em;max-height:4.2em;margin:0 0 .6em 1.5em}
p{margin:.5em 0}a{color:var(--blue)}.under,.muted,.unit,.below,figcaption{color:var(--soft)}
.below{font-size:.85em;margin-top:.2em}
code,.seal{font-family:ui-monospace,"DejaVu Sans Mono",monospace}
code{font-size:.88em;overflow-wrap:anywhere}pre{font-size:.85em;overflow-x:auto}
.seal{font-weight:700;letter-spacing:.05em;white-space:nowrap}
.sealbox .seal{font-size:1.35em;margin-left:.3em}
.note{border:1px solid var(--soft);border-left-width:5px;padding:.5em 1em;background:var(--head)}
.banner{font-size:1.3em;font-weight:700;padding:.5em .8em;border:2px solid;margin:.9em 0}
.banner.error{border-width:4px;border-style:double}
.v .mark,.banner .mark{display:inline-block;min-width:1.2em;text-align:center}
.data .v{display:inline-block;min-width:8em}.v.error{font-weight:700}
.v.warning,.v.open{font-weight:600}
.error{color:var(--red)}.warning,.open{color:var(--amber)}.clear{color:var(--ink)}
.note.clear,.v.note{color:var(--soft);background:none;border:0;padding:0}
.banner.note,.banner.clear{color:var(--ink)}
table.data{border-collapse:collapse;width:100%;margin:.4em 0;font-size:.93em}
.data th,.data td{text-align:left;vertical-align:top;padding:.35em .55em;
border-bottom:1px solid var(--line);overflow-wrap:break-word}
.data th{background:var(--head);border-bottom:1.5px solid var(--soft);font-size:.92em}
.data .num{text-align:right}.n{font-variant-numeric:tabular-nums}.n{white-space:nowrap}
sup{font-size:.7em;line-height:0;margin-left:.1em}
.sign td{height:2.1em}.landscape td.hand{border-left:1px solid var(--soft)}
.blank{display:block;min-width:5em;min-height:1.3em;
border-bottom:1px dotted var(--soft)}
ul{margin:.4em 0;padding-left:1.4em}.toc{columns:2;margin:.3em 0;padding:0;list-style:none}
figure{margin:.8em 0}figcaption{font-size:.85em}.pictures{display:grid;
grid-template-columns:repeat(auto-fill,minmax(min(100%,440px),1fr));gap:.2em 1.6em}
.pictures figure{margin:.3em 0}
.sheet,.sheet>tbody,.sheet>tbody>tr,.sheet>tbody>tr>td{display:block}
.sheet>thead,.sheet>tfoot{display:none}
.narrow{display:none}
.landscape{max-width:1400px}
@media print,screen and (min-width:701px){table.fixed{table-layout:fixed}}
@media screen and (max-width:900px){table.data{font-size:.84em}.data th,.data td{padding:.3em}
.n{white-space:normal}.data .v{min-width:0}}
@media screen and (max-width:700px){table.data{font-size:.93em}body{padding:.6em .7em 3em}
h1{font-size:1.5em}
.banner{font-size:1.1em}.toc{columns:1}
.data thead,.data colgroup{display:none}
.data,.data tbody,.data tr,.data td{display:block;width:100%}
.data tr{border:1px solid var(--line);margin:.5em 0;padding:.2em 0}
.data td,.data td.num{display:grid;grid-template-columns:8.2em 1fr;gap:0 .6em;text-align:left;
border:0;padding:.15em .6em;height:auto}.data td::before{content:attr(data-head);
color:var(--soft);font-size:.86em;grid-row:1/span 9}.data td>div{grid-column:2}
.n{white-space:normal}
figure{overflow-x:auto}section>figure>svg{min-width:600px}
section>figure:has(.narrow)>svg{display:none}.narrow{display:block}
.narrow>svg{min-width:0}}
@media print{
@page{size:A4;margin:13mm 13mm 15mm 15mm;@bottom-right{content:"page " counter(page) " of "
counter(pages);font:8.5pt sans-serif}}
@page wide{size:A4 landscape;margin:10mm 10mm 13mm}.landscape{page:wide}
.landscape table.data{font-size:8.5pt;line-height:1.3}.landscape .sign td{height:13mm}
body{font-size:9.3pt;max-width:none;margin:0;padding:0;-webkit-print-color-adjust:exact;
print-color-adjust:exact}
.sheet{display:table;width:100%;border-collapse:collapse;table-layout:fixed}
.sheet>thead{display:table-header-group}.sheet>tfoot{display:table-footer-group}
.sheet>tbody{display:table-row-group}.sheet>tbody>tr{display:table-row}
.sheet>thead>tr,.sheet>tfoot>tr{display:table-row}
.sheet>tbody>tr>td,.sheet>thead>tr>td,.sheet>tfoot>tr>td{display:table-cell;padding:0}
.pagehead{border-bottom:1px solid #000;padding-bottom:1mm;margin-bottom:3mm;font-size:8.5pt}
.pagefoot{border-top:1px solid #000;padding-top:1mm;margin-top:3mm;font-size:8pt}
.pagehead{display:table;table-layout:fixed;width:100%}.pagehead>span{display:table-cell}
.pagehead>.seal{width:15em;text-align:right}.pagehead>span,.pagefoot{white-space:nowrap;overflow:hidden;text-overflow:ellipsis}
.first h1{font-size:1.6em}.first h2{margin:1em 0 .3em}.first .banner{font-size:1.15em;margin:.7em 0;
padding:.35em .7em}.sealbox{margin:.3em 0}nav{break-inside:avoid}
.blank{border-bottom:.5pt solid #888}
.toc{columns:3;font-size:.88em}.page{break-before:page}.page .data{line-height:1.35}
.page h3{margin:1em 0 .3em}
main h2{margin-top:1.6em}main .page>h2{margin-top:.4em}
h2,h3,h2+p:not(:last-child),h3+p:not(:last-child){break-after:avoid}
.data tr,figure,.note,.banner{break-inside:avoid}
.data thead{display:table-header-group}.pictures{grid-template-columns:1fr 1fr}
figure svg{max-height:225mm}
a{color:inherit;text-decoration:none}.data th,.data td{padding:.25em .4em}}
"""
)


def standalone_picture(svg: str) -> str:
    """Return a drawing as a whole SVG file, with the colours of the pages."""
    style = (
        f"<style>{PICTURES}{_COLOURS}svg{{background:var(--back);font-family:sans-serif}}</style>"
    )
    head, _, rest = svg.partition(">")
    return f'{head} xmlns="http://www.w3.org/2000/svg">{style}{rest}'
