"""Mitsuba's meshes of a scene are made once, for as long as nothing about its surfaces changes."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import worlds
from spisim import load_instrument
from spisim.scene import Material, Scene
from spisim.transport import ground_truth
from spisim.transport.backend import activate
from spisim.transport.meshes import _CACHED, Meshes
from spisim.transport.world import build_world


def scene() -> Scene:
    return worlds.scene(*worlds.room())


def test_other_poses_and_fog_share_one_search_tree() -> None:
    position = scene()
    first = build_world(position)
    moved = replace(position, drone_pose=worlds.pose_at((0.1, 0.0, 0.2)))
    assert build_world(moved).geometry.scene is first.geometry.scene


def test_truth_and_light_share_one_search_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    built = []
    make = Meshes._made
    monkeypatch.setattr(Meshes, "_made", lambda objects: built.append(objects) or make(objects))
    position = scene()
    ground_truth(position, load_instrument("paper"))
    build_world(position)
    ground_truth(position, load_instrument("paper"))
    assert len(built) == 1


def test_a_mesh_that_was_moved_in_place_is_seen_where_it_is() -> None:
    activate()
    position = scene()
    before = Meshes.of(position.objects)
    position.objects[0].mesh.apply_translation((0.0, 0.0, 0.5))
    after = Meshes.of(position.objects)
    assert after is not before
    assert after.scene.bbox() != before.scene.bbox()


def test_another_material_makes_other_meshes() -> None:
    activate()
    first, *others = scene().objects
    one = Meshes.of((first, *others))
    assert Meshes.of((first, *others)) is one
    half = Material("m", first.material.reflectance / 2, "test")
    assert Meshes.of((replace(first, material=half), *others)) is not one


def test_a_picture_that_was_changed_in_place_makes_other_meshes() -> None:
    activate()
    picture = np.full((2, 2), 0.5, np.float32)
    objects = [replace(scene().objects[0], material=Material("m", 0.5, "test", opacity=picture))]
    objects[0].mesh.visual = trimesh.visual.TextureVisuals(uv=objects[0].mesh.vertices[:, :2])
    one = Meshes.of(objects)
    assert Meshes.of(objects) is one
    picture[0, 0] = 0.6
    assert Meshes.of(objects) is not one


def test_no_more_than_one_scene_is_there() -> None:
    """Dr.Jit's kernels have code for all that there are, of whatever scene."""
    activate()
    first, second = scene(), scene()
    second.objects[0].mesh.apply_scale(1.5)
    before = weakref.ref(Meshes.of(first.objects))
    Meshes.of(second.objects)
    gc.collect()
    assert before() is None


def test_materials_that_are_alike_share_a_mesh() -> None:
    activate()
    objects = tuple(
        replace(thing, material=Material(f"m{number}", 0.5, "test"))
        for number, thing in enumerate(scene().objects)
    )
    assert len(Meshes.of(objects).scene.shapes()) == 1


def test_meshes_go_with_their_objects() -> None:
    activate()
    position = scene()
    Meshes.of(position.objects)
    gc.collect()
    before = len(_CACHED)
    del position
    gc.collect()
    assert len(_CACHED) == before - 1
