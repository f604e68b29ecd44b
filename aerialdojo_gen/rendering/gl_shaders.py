"""The GLSL programs of the OpenGL renderer: the formulas of `aerialdojo_gen.rendering.shading`, a pixel at a time.

A pixel is two whole numbers: the four bytes of its colour, and the bits of its depth. llvmpipe writes one such target
in less time than a target of colours and one of depths, and it is read back in one piece.
"""

from __future__ import annotations

from aerialdojo_gen.rendering import shading

_HEAD = "#version 400 core\n"

_VERTEX = (
    _HEAD
    + """
uniform mat4 clip_from_world;
uniform mat4 sun_from_world;
uniform vec3 eye;
uniform vec3 sun;
uniform float bias_m;
in vec3 position;
in vec3 normal;
in vec4 colour;
#ifdef TEXTURED
in vec2 uv;
in float texel_m;
in float layer;
out vec2 v_uv;
flat out vec2 v_texture;
flat out vec3 v_normal;
#endif
#ifdef INSTANCES
in float instance;
flat out float v_instance;
#endif
#ifdef ATLAS
in vec2 uv;
in float layer;
out vec2 v_uv;
flat out float v_layer;
#endif
out vec3 v_ray;
out vec4 v_sun;
#ifdef FOREIGN
out vec3 v_colour;
flat out float v_lit;
#else
flat out vec3 v_colour;
#endif
flat out vec2 v_light;
void main() {
    gl_Position = clip_from_world * vec4(position, 1.0);
    vec3 n = normal;
#ifdef FOREIGN
    // The side that is seen is the one that is lit; which it is, is the same at all corners.
    n *= dot(normal, eye - position) < 0.0 ? -1.0 : 1.0;
    v_lit = 1.0 - colour.a;
#endif
#ifdef BACKDROP
    // Behind everything but the sky.
    gl_Position.z = gl_Position.w * 0.9999999;
#endif
    v_ray = position - eye;
    vec4 s = sun_from_world * vec4(position + n * bias_m, 1.0);
    v_sun = vec4((s.xyz + s.w) * 0.5, s.w);
    v_colour = colour.rgb * 255.0;
    v_light = vec2(AMBIENT + FROM_ABOVE * n.z + FROM_EAST * n.x + FROM_NORTH * n.y, SUN * max(dot(n, sun), 0.0));
#ifdef TEXTURED
    v_uv = uv;
    v_texture = vec2(layer, texel_m);
    v_normal = n;
#endif
#ifdef ATLAS
    v_uv = uv;
    v_layer = layer;
#endif
#ifdef INSTANCES
    v_instance = instance + 1.0;
#endif
}
"""
)

_FRAGMENT = (
    _HEAD
    + """
uniform sampler2D shadow;
uniform vec3 horizon;
uniform float focal_px;
#ifdef TEXTURED
uniform sampler2DArray textures;
in vec2 v_uv;
flat in vec2 v_texture;
flat in vec3 v_normal;
#endif
#ifdef ATLAS
uniform sampler2DArray textures;
in vec2 v_uv;
flat in float v_layer;
#endif
in vec3 v_ray;
in vec4 v_sun;
#ifdef FOREIGN
in vec3 v_colour;
flat in float v_lit;
#else
flat in vec3 v_colour;
#endif
flat in vec2 v_light;
layout(location = 0) out uvec2 out_pixel;
#ifdef INSTANCES
flat in float v_instance;
layout(location = 1) out float out_instance;
#endif
void main() {
    float range_m = length(v_ray);
    vec3 base = v_colour;
#ifdef TEXTURED
    float facing = -dot(v_normal, v_ray) / range_m;
    float texels = range_m / (focal_px * v_texture.y * sqrt(max(facing, 0.02)));
    float keep = clamp((FADE - texels) / (FADE - 1.0), 0.0, 1.0);
    base = mix(base, texture(textures, vec3(v_uv, v_texture.x)).rgb * 255.0, keep);
#endif
#ifdef ATLAS
    vec4 texel = texture(textures, vec3(v_uv, v_layer));
    base = texel.rgb * 255.0;
#endif
#ifdef MASK
    // Mipmaps average alpha: a lower threshold at a distance, or trees would lose their leaves.
    if (texel.a < 0.5 - 0.2 * clamp(textureQueryLod(textures, v_uv).y / 4.0, 0.0, 1.0)) discard;
#endif
#ifdef BACKDROP
    out_pixel = uvec2(packUnorm4x8(vec4(base / 255.0, 1.0)), ENDLESS);
#ifdef INSTANCES
    out_instance = 0.0;
#endif
    return;
#endif
    // The mean of four comparisons, weighted as a linear filter would.
    vec3 at = v_sun.xyz / v_sun.w;
    vec4 lit_by = step(vec4(at.z), textureGather(shadow, at.xy));
    vec2 share = fract(at.xy * vec2(textureSize(shadow, 0)) - 0.5);
    vec2 column = mix(lit_by.wx, lit_by.zy, share.x);
    float lit = v_light.y * mix(column.x, column.y, share.y);
    float haze = 1.0 - exp(range_m * (-1.0 / HAZE_RANGE));
#ifdef FOREIGN
    base *= mix(1.0, v_light.x + lit, v_lit);
    vec3 value = mix(base, horizon, haze * haze);
#else
    vec3 value = mix(base * (v_light.x + lit), horizon, haze * haze);
#endif
    out_pixel = uvec2(packUnorm4x8(vec4(value / 255.0, 1.0)), floatBitsToUint(1.0 / gl_FragCoord.w));
#ifdef INSTANCES
    out_instance = v_instance;
#endif
}
"""
)

_SUN_VERTEX = (
    _HEAD
    + """
uniform mat4 clip_from_world;
in vec3 position;
#ifdef MASK
in vec2 uv;
in float layer;
out vec2 v_uv;
flat out float v_layer;
#endif
void main() {
    gl_Position = clip_from_world * vec4(position, 1.0);
#ifdef MASK
    v_uv = uv;
    v_layer = layer;
#endif
}
"""
)

_SUN_FRAGMENT = (
    _HEAD
    + """
#ifdef MASK
uniform sampler2DArray textures;
in vec2 v_uv;
flat in float v_layer;
#endif
void main() {
#ifdef MASK
    if (texture(textures, vec3(v_uv, v_layer)).a < 0.5) discard;
#endif
}
"""
)

_SKY_VERTEX = (
    _HEAD
    + """
uniform mat3 world_from_camera;
uniform vec2 reach;  // half the picture's width and height at a depth of 1
out vec3 v_ray;
void main() {
    // One triangle over the whole picture, at the far end.
    vec2 p = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1);
    v_ray = world_from_camera * vec3(p * reach, 1.0);
    gl_Position = vec4(p, 1.0, 1.0);
}
"""
)

_SKY_FRAGMENT = (
    _HEAD
    + """
uniform vec3 horizon;
uniform vec3 zenith;
in vec3 v_ray;
layout(location = 0) out uvec2 out_pixel;
#ifdef INSTANCES
layout(location = 1) out float out_instance;
#endif
void main() {
    float up = pow(max(v_ray.z, 0.0) / length(v_ray), 0.55);
    out_pixel = uvec2(packUnorm4x8(vec4(mix(horizon, zenith, up) / 255.0, 1.0)), ENDLESS);
#ifdef INSTANCES
    out_instance = 0.0;
#endif
}
"""
)

# A vertex and a fragment program each.
SURFACES = (_VERTEX, _FRAGMENT)
SUN = (_SUN_VERTEX, _SUN_FRAGMENT)
SKY = (_SKY_VERTEX, _SKY_FRAGMENT)


def specialise(source: str, *defined: str) -> str:
    """Give a program its constants and its variant."""
    constants = {
        "AMBIENT": shading._AMBIENT,
        "FROM_ABOVE": shading._FROM_ABOVE,
        "FROM_EAST": shading._FROM_EAST,
        "FROM_NORTH": shading._FROM_NORTH,
        "SUN": shading._SUN,
        "HAZE_RANGE": shading._HAZE_RANGE_M,
        "FADE": shading._FADE_TEXELS,
    }
    lines = [f"#define {name} {value:.6f}" for name, value in constants.items()]
    # The bits of an endless depth.
    lines.append("#define ENDLESS 0x7f800000u")
    lines += [f"#define {name}" for name in defined]
    return source.replace(_HEAD, _HEAD + "\n".join(lines) + "\n", 1)
