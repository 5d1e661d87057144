// Types of fragment outputs. An output of one of these types is drawn to a texture of that format.

alias RGBA32Float = vec4f;
alias RGBA16Float = vec4f;
alias RG32Float = vec2f;
alias R32Float = f32;
alias R32Uint = u32;
alias RG32Uint = vec2u;
alias RGBA8Unorm = vec4f;
alias RGBA8UnormSrgb = vec4f;
