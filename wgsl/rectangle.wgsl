// Passes over a part of the screen.

// A corner, of six, of the two triangles that cover `rectangle`: left, bottom, right and top in clip space.
fn rectangle_corner(i: u32, rectangle: vec4f) -> vec4f {
    let right = i == 1u || i == 2u || i == 4u;
    let top = i == 2u || i == 4u || i == 5u;
    return vec4f(select(rectangle.x, rectangle.z, right), select(rectangle.y, rectangle.w, top), 0.0, 1.0);
}
