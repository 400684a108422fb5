"""Which card is taken, without a card."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from carstage_sim.render.gpu import device


@pytest.fixture
def only_a_software_driver(monkeypatch):
    info = {"adapter_type": "CPU", "device": "llvmpipe", "backend_type": "Vulkan"}
    monkeypatch.setattr(device, "_adapters", lambda: [SimpleNamespace(info=info)])
    monkeypatch.delenv(device.SOFTWARE_VARIABLE, raising=False)


def test_auto_never_takes_a_driver_that_computes_on_the_cpu(only_a_software_driver, monkeypatch):
    monkeypatch.setenv(device.SOFTWARE_VARIABLE, "1")
    assert device.chosen_gpu("auto") is None


@pytest.mark.usefixtures("only_a_software_driver")
def test_asking_for_a_card_that_is_not_there_says_what_was_seen():
    with pytest.raises(device.NoGpuError, match=r"no hardware GPU .* seen: llvmpipe"):
        device.chosen_gpu("gpu")


def test_a_card_that_cannot_do_what_is_needed_is_named_or_passed_over(monkeypatch):
    info = {"adapter_type": "DiscreteGPU", "device": "old card", "backend_type": "Vulkan"}
    adapter = SimpleNamespace(info=info, features=frozenset())
    monkeypatch.setattr(device, "_adapters", lambda: [adapter])
    with pytest.raises(device.NoGpuError, match="old card cannot write into a program's memory"):
        device.chosen_gpu("gpu")
    assert device.chosen_gpu("auto") is None


def test_the_cpu_is_taken_without_looking_for_cards(monkeypatch):
    monkeypatch.setattr(device, "_adapters", None)
    assert device.chosen_gpu("cpu") is None
