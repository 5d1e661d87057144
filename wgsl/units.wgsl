// Units and conventions of all modules.
//
//   lengths          millimetres
//   radiometry       irradiance in W/m^2, radiance in W/(m^2 sr), intensity in W/sr; RGB, linear, Rec.709 primaries
//   world space      right-handed, y up
//   camera space     looks down -z; clip space z in 0..1
//   textures         u to the right, v down; texel (i, j) has its centre at ((i + 1/2) / width, (j + 1/2) / height)
//   triangles        counter-clockwise seen from outside
//
//   x_i, n_i         point where light enters, and the normal there
//   x_o, n_o         point where light leaves, and the normal there
//   w_i, w_o         unit directions from the surface to the light and to the viewer
//   L_d              transmitted irradiance: the light that enters at x_i             (Maisch & Ropinski 2017, eq. 4)
//   M                the surface integral of R_d L_d, split into M_front and M_back   (eq. 6, 7)
//   R_d              diffusion profile, 1/mm^2
//   rho_dt           share of the light that the surface does not reflect             (eq. 3)

alias Length = f32;       // mm
alias Area = f32;         // mm^2
alias Position = vec3f;   // mm
alias Direction = vec3f;  // of length 1
alias Irradiance = vec3f; // W/m^2
alias Radiance = vec3f;   // W/(m^2 sr)
alias Number = f32;

const PI: Number = 3.14159265358979;
const MM_PER_M: Length = 1000.0;
