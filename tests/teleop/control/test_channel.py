"""The communication channel: delay, jitter, loss, newest packet, and the text of its settings."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.control.channel import ChannelSettings, Direction, parse_channel

SETTINGS = st.builds(
    ChannelSettings,
    delay=st.sampled_from([0.0, 3e-3, 0.05]),
    jitter=st.sampled_from([0.0, 4e-3, 0.02]),
    loss=st.sampled_from([0.0, 0.05, 0.5]),
)


def received(settings, seed, ticks=300):
    """Send the number of each tick; return the value that is received at each tick."""
    direction = Direction(settings, f"{seed}", -1)
    direction.reset(0.0, -1)
    return [(direction.exchange(n * 1e-3, n), n * 1e-3 - direction.sent) for n in range(ticks)]


@given(SETTINGS, st.integers(0, 100))
def test_the_receiver_keeps_the_newest_packet_and_knows_its_age(settings, seed):
    values = received(settings, seed)
    numbers = [value for value, _ in values]
    assert numbers == sorted(numbers)
    for n, (number, age) in enumerate(values):
        if number >= 0:
            assert age == pytest.approx((n - number) * 1e-3)
            assert age >= settings.delay - 1e-9
    assert received(settings, seed) == values


@given(SETTINGS, st.integers(0, 100))
def test_no_packet_that_was_sent_during_an_interruption_arrives(settings, seed):
    direction = Direction(settings, f"{seed}", -1)
    for n in range(300):
        direction.cut = 100 < n < 150
        assert not 100 < direction.exchange(n * 1e-3, n) < 150


@given(SETTINGS.filter(lambda s: not s.loss), st.integers(0, 100))
def test_without_loss_a_value_is_never_older_than_delay_and_jitter(settings, seed):
    for n, (number, age) in enumerate(received(settings, seed)):
        if n * 1e-3 >= settings.delay + settings.jitter:
            assert number >= 0
            assert age <= settings.delay + settings.jitter + 1e-3 + 1e-9


def test_without_jitter_and_loss_the_delay_is_exact():
    values = received(ChannelSettings(delay=5e-3), 0)
    assert [number for number, _ in values[5:]] == list(range(295))
    assert [number for number, _ in values[:4]] == [-1] * 4


def test_the_loss_is_the_stated_fraction():
    values = {number for number, _ in received(ChannelSettings(loss=0.3), 1, ticks=20_000)}
    assert 1.0 - len(values) / 20_000 == pytest.approx(0.3, abs=0.02)


def test_two_directions_with_other_seeds_lose_other_packets():
    settings = ChannelSettings(loss=0.5)
    assert received(settings, 0) != received(settings, 1)


def test_silence_is_the_time_since_a_packet_arrived_or_was_expected():
    direction = Direction(ChannelSettings(delay=0.1), "0", 0)
    direction.reset(1.0, 0)
    direction.exchange(1.0, 1)
    assert direction.exchange(1.05, 2) == 0
    assert direction.due > 1.05
    direction.cut = True
    assert direction.exchange(1.2, 3) == 2
    direction.exchange(1.4, 4)
    assert direction.due == 1.2


@given(SETTINGS)
def test_the_text_of_a_channel_gives_the_same_settings(settings):
    parsed = parse_channel(settings.text)
    for name in ("delay", "jitter", "loss", "max_silence"):
        assert getattr(parsed, name) == pytest.approx(getattr(settings, name))


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        ("delay=100ms,jitter=20ms,loss=5%", ChannelSettings(0.1, 0.02, 0.05)),
        (" delay = 0.1 s , loss = 0.05", ChannelSettings(0.1, 0.0, 0.05)),
        ("jitter=500us,max_silence=50ms", ChannelSettings(jitter=5e-4, max_silence=0.05)),
    ],
)
def test_times_and_fractions_have_units(text, settings):
    assert parse_channel(text) == settings


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("banana", "banana"),
        ("", "expected a text such as"),
        ("delay=100", "delay of the channel must be 0 to 2 s, got 100 s"),
        ("delay=ms", "expected a time"),
        ("loss=5ms", "expected a fraction or a percentage"),
        ("delay=1ms,delay=2ms", "delay=2ms"),
        ("delay=5s", "delay of the channel must be 0 to 2 s"),
        ("delay=-1ms", "delay of the channel"),
        ("delay=nanms", "delay"),
        ("loss=100%", "loss of the channel"),
        ("max_silence=0ms", "max_silence of the channel"),
    ],
)
def test_a_text_that_is_not_a_channel_is_refused(text, named):
    with pytest.raises(ValueError, match=named) as error:
        parse_channel(text)
    assert "\n" not in str(error.value)
