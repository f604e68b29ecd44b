"""The GLSL programs of the OpenGL renderer: the formulas of `aerialdojo_gen.rendering.shading`, a pixel at a time.

A pixel is two whole numbers: the four bytes of its colour, and the bits of its depth. llvmpipe writes one such target
in less time than a target of colours and one of depths, and it is read back in one piece.
"""

from __future__ import annotations

from aerialdojo_gen.rendering import lighting, shading

_HEAD = "#version 400 core\n"
# Contrast of a natural texture at its larger scales.
_GRAIN = 0.55

# Edge of the shadow map.
SHADOW_PX = 2048

# The sky in a direction, as `aerialdojo_gen.rendering.shading` has it.
_SKY = """
uniform vec3 horizon;
uniform vec3 zenith;
uniform vec3 air;  // square of the range of haze, share of clouds, wetness
uniform sampler2D clouds;
vec3 sky_at(vec3 dir) {
    float z = max(dir.z, 0.0);
    float thick = textureLod(clouds, dir.xy * (CLOUD_SCALE / (z + CLOUD_FLAT)), 0.0).r;
    thick = clamp((thick - 0.86 + 0.8 * air.y) * 3.2, 0.0, 1.0) * min(z * 7.0, 1.0);
    vec3 blue = mix(horizon, zenith, sqrt(z));
    vec3 white = horizon * 0.25 + 0.741 - 0.133 * air.y * thick;
    return mix(blue, white, thick * (0.85 - 0.35 * air.y));
}
"""

_VERTEX = (
    _HEAD
    + """
uniform mat4 clip_from_world;
uniform mat4 sun_from_world;
uniform vec3 eye;
uniform vec3 sun;
uniform vec2 side;
uniform float bias_m;
uniform float focal_px;
in vec3 position;
in vec3 normal;
in vec4 colour;
#ifdef TEXTURED
in vec2 uv;
in float texel_m;
in float layer;
out vec2 v_uv;
flat out vec2 v_texture;
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
out vec3 v_light;
flat out vec3 v_normal;
#ifdef HORIZON
out vec4 v_air;  // colour and thickness of the haze before it
uniform vec3 horizon;
uniform vec3 zenith;
uniform vec3 air;
uniform vec3 sun_rgb;
uniform vec3 sky_rgb;
uniform vec3 ground_rgb;
#else
out vec4 v_sun;
#endif
#ifdef FOREIGN
out vec3 v_colour;
flat out float v_lit;
#else
flat out vec3 v_colour;
#endif
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
    v_normal = n;
    v_colour = colour.rgb;
    v_light = vec3(0.5 + 0.5 * n.z, 1.0 + dot(n.xy, side), max(dot(n, sun), 0.0));
#ifdef HORIZON
    v_light = mix(ground_rgb, sky_rgb, v_light.x) * v_light.y + sun_rgb * v_light.z;
    float range_2 = dot(v_ray, v_ray), range_m = sqrt(range_2);
    // The land's end is the sky.
    v_air = vec4(mix(horizon, zenith, sqrt(max(v_ray.z, 0.0) / range_m)),
                 max(range_2 / (range_2 + air.x), smoothstep(END * 0.5, END, range_m)));
#else
    vec4 s = sun_from_world * vec4(position + n * bias_m, 1.0);
    v_sun = vec4((s.xyz + s.w) * 0.5, s.w);
#endif
#ifdef TEXTURED
    v_uv = uv;
    v_texture = vec2(layer, focal_px * focal_px * texel_m * texel_m);
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
    + _SKY
    + """
uniform sampler2D shadow;
uniform sampler2D heights;
uniform vec3 eye;
uniform vec2 place;  // the map of heights: its south-western corner, and one over its extent
uniform vec2 extent;
uniform float lowest_m;
uniform vec3 sun_rgb;
uniform vec3 sky_rgb;
uniform vec3 ground_rgb;
#ifdef TEXTURED
uniform sampler2DArray textures;
in vec2 v_uv;
flat in vec2 v_texture;
#endif
#ifdef ATLAS
uniform sampler2DArray textures;
in vec2 v_uv;
flat in float v_layer;
#endif
in vec3 v_ray;
in vec3 v_light;
flat in vec3 v_normal;
#ifdef HORIZON
in vec4 v_air;
#else
in vec4 v_sun;
#endif
#ifdef FOREIGN
in vec3 v_colour;
flat in float v_lit;
#else
flat in vec3 v_colour;
#endif
layout(location = 0) out uvec2 out_pixel;
#ifdef INSTANCES
flat in float v_instance;
layout(location = 1) out float out_instance;
#endif
void main() {
    float range_2 = dot(v_ray, v_ray), nearness = inversesqrt(range_2);
    vec3 base = v_colour;
    float facing = -dot(v_normal, v_ray) * nearness;
#ifdef TEXTURED
    float texels_2 = range_2 / (v_texture.y * max(facing, 0.02));
#ifdef NATURAL
    // The next layer eight times as large, and again: ground has grain at every distance. By the square of the
    // texels a pixel, for a logarithm takes long.
    vec3 at = texels_2 < 28.0 ? vec3(v_uv, v_texture.x)
        : vec3(v_uv * (texels_2 < 1800.0 ? 0.125 : 0.015625), v_texture.x + 1.0);
    vec3 grain = texture(textures, at).rgb;
    base += (grain - base) * max(1.0 - 0.016 * texels_2, GRAIN);
#else
    float keep = clamp((FADE * FADE - texels_2) * (1.0 / (FADE * FADE - 1.0)), 0.0, 1.0);
    base = mix(base, texture(textures, vec3(v_uv, v_texture.x)).rgb, keep);
#endif
#endif
#ifdef ATLAS
    vec4 texel = texture(textures, vec3(v_uv, v_layer));
    base = texel.rgb;
#endif
#ifdef MASK
    // Mipmaps average alpha: a lower threshold at a distance, or trees would lose their leaves.
    if (texel.a < 0.5 - 0.2 * clamp(textureQueryLod(textures, v_uv).y / 4.0, 0.0, 1.0)) discard;
#endif
#ifdef BACKDROP
    out_pixel = uvec2(packUnorm4x8(vec4(base, 1.0)), ENDLESS);
#ifdef INSTANCES
    out_instance = 0.0;
#endif
    return;
#endif
    vec3 albedo = base * base;
#ifdef HORIZON
    vec3 linear = albedo * v_light;
#else
    // The mean of four comparisons, weighted as a linear filter would.
    vec3 at_sun = v_sun.xyz / v_sun.w;
    vec4 lit_by = step(vec4(at_sun.z), textureGather(shadow, at_sun.xy));
    vec2 part = fract(at_sun.xy * SHADOW_PX - 0.5);
    vec2 column = mix(lit_by.wx, lit_by.zy, part.x);
    float lit = v_light.z * mix(column.x, column.y, part.y);
    // What is deep below its surroundings sees less of the sky.
#ifdef TEXTURED
    // From the ray: an output of the vertices less.
    vec2 on_map = (v_ray.xy + v_normal.xy * BEFORE + (eye.xy - place)) * extent;
    float below = (lowest_m - BEFORE - eye.z - v_ray.z) * (1.0 / DEEP);
    float deep = clamp(textureLod(heights, on_map, 0.0).r * (REACH / DEEP) + below, 0.0, 1.0);
#else
    float deep = 0.0;
#endif
    vec3 from_sky = mix(ground_rgb, sky_rgb, v_light.x) * (v_light.y * (1.0 - SHADED * deep));
#ifdef WET
    float level = clamp(4.0 * v_normal.z - 3.0, 0.0, 1.0) * air.z;
    albedo *= 1.0 - (1.0 - WETNESS) * level;
#endif
    vec3 linear = albedo * (from_sky + sun_rgb * lit);
#endif
    vec3 value = linear / (linear + TOE) * GAIN;
#ifdef FOREIGN
    value = mix(base, value, v_lit);
#endif
#ifdef HORIZON
    value = mix(value, v_air.rgb, v_air.a);
    out_pixel = uvec2(packUnorm4x8(vec4(value, 1.0)), ENDLESS);
#else
#if defined(SHINY) || defined(WET)
#ifdef SHINY
    float mirror = 1.0;
#else
    float mirror = level * 0.6;
#endif
    float glance = 1.0 - facing;
    mirror *= MIRROR_LEAST + (MIRROR_MOST - MIRROR_LEAST) * glance * glance * glance;
    value = mix(value, sky_at(v_ray * nearness + 2.0 * facing * v_normal), mirror);
#endif
    float haze = range_2 / (range_2 + air.x);
    value = mix(value, horizon, haze);
    out_pixel = uvec2(packUnorm4x8(vec4(value, 1.0)), floatBitsToUint(1.0 / gl_FragCoord.w));
#endif
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
    + _SKY
    + """
in vec3 v_ray;
layout(location = 0) out uvec2 out_pixel;
#ifdef INSTANCES
layout(location = 1) out float out_instance;
#endif
void main() {
    out_pixel = uvec2(packUnorm4x8(vec4(sky_at(normalize(v_ray)), 1.0)), ENDLESS);
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
        "SHADED": shading._SHADED,
        "DEEP": shading._DEEP_M,
        "BEFORE": shading._BEFORE_M,
        "TOE": shading._TOE,
        "GAIN": shading._GAIN,
        "MIRROR_LEAST": shading._MIRROR_LEAST,
        "MIRROR_MOST": shading._MIRROR_MOST,
        "WETNESS": shading._WET,
        "FADE": shading._FADE_TEXELS,
        "CLOUD_FLAT": shading._CLOUD_FLAT,
        "CLOUD_SCALE": shading._CLOUD_SCALE,
        "GRAIN": _GRAIN,
        "REACH": lighting.REACH_M,
        "END": shading._END_M,
        "SHADOW_PX": SHADOW_PX,
    }
    lines = [f"#define {name} {value:.6f}" for name, value in constants.items()]
    # The bits of an endless depth.
    lines.append("#define ENDLESS 0x7f800000u")
    lines += [f"#define {name}" for name in defined]
    return source.replace(_HEAD, _HEAD + "\n".join(lines) + "\n", 1)
