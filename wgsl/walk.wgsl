// Walks over the surface in an atlas, from chart to chart. This module owns the bindings of the atlas; a pass that imports
// it is given them as `ids` and `seams` of `Charts` (wgsss/bake/charts.py).

import package::charts::{INSIDE, Seam, across, id_at, settled};

@group(1) @binding(16) var ids: texture_2d<u32>;
@group(1) @binding(17) var<storage, read> seams: array<Seam>;

const MAX_CROSSINGS: u32 = 6u;
const BISECTIONS: u32 = 8u; // finds the crossing to a texel in steps of up to 256

// Whether uv is in the gutter of a chart, given by its id. Between two charts that are close, a texel belongs to the
// gutter of the nearer one.
fn leads_out_of(chart: u32, uv: vec2f) -> bool {
    let id = id_at(ids, uv);
    return id != 0u && (id & INSIDE) == 0u && (INSIDE | seams[max(id, 1u) - 1u].chart) == chart;
}

// The point that is reached from `start`, inside a chart, by going `step` along the surface.
fn walk(start: vec2f, step: vec2f) -> vec2f {
    let size = vec2f(textureDimensions(ids));
    var a = start;
    var b = start + step;
    for (var i = 0u; i < MAX_CROSSINGS; i++) {
        let chart = id_at(ids, a);
        let end = id_at(ids, b);
        if end == chart || chart == 0u {
            break;
        }
        var seam_id = chart;
        if (chart & INSIDE) != 0u { // otherwise `a` is at a corner, in the gutter of the chart that it has come to
            var inside = 0.0; // bisection finds where a to b crosses the border
            var outside = 1.0;
            for (var k = 0u; k < BISECTIONS; k++) {
                let middle = 0.5 * (inside + outside);
                if id_at(ids, mix(a, b, middle)) == chart {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            let at_border = mix(a, b, inside);
            // One texel farther, to arrive inside the neighbouring chart and not on its border.
            let beyond = mix(a, b, min(outside + 1.0 / length((b - a) * size), 1.0));
            a = select(mix(a, b, outside), beyond, leads_out_of(chart, beyond));
            seam_id = id_at(ids, a);
            if !leads_out_of(chart, a) { // charts that touch have no gutter: stop at the border
                return at_border;
            }
        }
        let seam = seams[seam_id - 1u];
        a = settled(ids, across(seam, a));
        b = across(seam, b);
    }
    return select(a, b, id_at(ids, a) == id_at(ids, b));
}
