"""Collada and FBX files of one triangle mesh with a texture, ``board.png``, as text."""

from __future__ import annotations

from typing import Any

import numpy as np

_COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="meter" meter="1"/><up_axis>{up}_UP</up_axis></asset>
<library_images><image id="i"><init_from>board.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><lambert><diffuse><texture texture="t" texcoord="UV"/></diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="{n3}">{vertices}</float_array><technique_common>
<accessor source="#pa" count="{n}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="u"><float_array id="ua" count="{n2}">{uv}</float_array><technique_common>
<accessor source="#ua" count="{n}" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{m}" material="m"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="0" set="0"/><p>{faces}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node id="Body" name="Body"><translate>{move}</translate>
<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="#m">
<bind_vertex_input semantic="UV" input_semantic="TEXCOORD" input_set="0"/></instance_material></technique_common>
</bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>
"""
_FBX = """; FBX 7.4.0 project file
FBXHeaderExtension:  {{
	FBXHeaderVersion: 1003
	FBXVersion: 7400
}}
Objects:  {{
	Geometry: 1, "Geometry::", "Mesh" {{
		Vertices: *{n3} {{
			a: {vertices}
		}}
		PolygonVertexIndex: *{m3} {{
			a: {faces}
		}}
		GeometryVersion: 124
		LayerElementUV: 0 {{
			Version: 101
			Name: "UVMap"
			MappingInformationType: "ByPolygonVertex"
			ReferenceInformationType: "Direct"
			UV: *{m6} {{
				a: {uv}
			}}
		}}
		LayerElementMaterial: 0 {{
			Version: 101
			Name: ""
			MappingInformationType: "AllSame"
			ReferenceInformationType: "IndexToDirect"
			Materials: *1 {{
				a: 0
			}}
		}}
		Layer: 0 {{
			Version: 100
			LayerElement:  {{
				Type: "LayerElementUV"
				TypedIndex: 0
			}}
			LayerElement:  {{
				Type: "LayerElementMaterial"
				TypedIndex: 0
			}}
		}}
	}}
	Model: 2, "Model::Body", "Mesh" {{
		Version: 232
		Properties70:  {{
			P: "Lcl Translation", "Lcl Translation", "", "A",{move}
		}}
	}}
	Material: 3, "Material::Brick", "" {{
		Version: 102
		ShadingModel: "phong"
		Properties70:  {{
			P: "DiffuseColor", "Color", "", "A",1,1,1
		}}
	}}
	Texture: 4, "Texture::Board", "" {{
		Type: "TextureVideoClip"
		Version: 202
		TextureName: "Texture::Board"
		FileName: "C:\\\\scans\\\\board.png"
		RelativeFilename: "board.png"
	}}
}}
Connections:  {{
	C: "OO",2,0
	C: "OO",1,2
	C: "OO",3,2
	C: "OP",4,3, "DiffuseColor"
}}
"""


def collada(vertices: Any, faces: Any, uv: Any = None, up: str = "z", move: tuple[float, ...] = (0, 0, 0)) -> str:
    """Write vertices (n, 3), faces (m, 3) and texture coordinates (n, 2), moved by a node."""
    v, f, uv = _arrays(vertices, faces, uv)
    texts = {name: " ".join(map(str, array.ravel().tolist())) for name, array in (("vertices", v), ("uv", uv))}
    return _COLLADA.format(
        up=up.upper(), n=len(v), n2=2 * len(v), n3=3 * len(v), m=len(f), move=" ".join(map(str, move)),
        faces=" ".join(map(str, f.ravel().tolist())), **texts,
    )  # fmt: skip


def fbx(vertices: Any, faces: Any, uv: Any = None, move: tuple[float, ...] = (0, 0, 0)) -> str:
    """Write vertices (n, 3), faces (m, 3) and texture coordinates (n, 2), moved by a node; y up."""
    v, f, uv = _arrays(vertices, faces, uv)
    corners = ",".join(f"{a},{b},{-c - 1}" for a, b, c in f.tolist())
    texts = {"vertices": v, "uv": uv[f], "move": np.array(move)}
    return _FBX.format(
        n3=3 * len(v), m3=3 * len(f), m6=6 * len(f), faces=corners,
        **{name: ",".join(map(str, array.ravel().tolist())) for name, array in texts.items()},
    )  # fmt: skip


def _arrays(vertices: Any, faces: Any, uv: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    v = np.asarray(vertices, dtype=float)
    return v, np.asarray(faces), np.zeros((len(v), 2)) if uv is None else np.asarray(uv, dtype=float)
