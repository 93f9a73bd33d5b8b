"""Controlled vocabulary of column names: the words for each quantity, in the languages that logs are written in.

A word is lower case and without accents (``velocità`` stands here as ``velocita``).
"""

from __future__ import annotations

import re
import unicodedata

#: By quantity, in the order of preference; a name's first quantity in this order decides.
WORDS = {
    "vdot": (
        "vdot", "ddq", "qdd", "qacc", "acceleration", "accelerations", "acc", "accel",
        "beschleunigung", "aceleracion", "accelerazione", "aceleracao", "加速度", "가속도", "ускорение",
    ),
    "v": (
        "dq", "qd", "qdot", "qvel", "velocity", "velocities", "vel", "speed", "speeds", "omega", "v",
        "geschwindigkeit", "drehzahl", "geschw", "velocidad", "vitesse", "velocita", "velocidade",
        "速度", "转速", "속도", "скорость",
    ),
    "tau": (
        "tau", "torque", "torques", "effort", "efforts", "moment", "moments", "trq", "current", "currents", "amps",
        "i", "drehmoment", "momento", "par", "couple", "coppia", "strom", "corriente", "courant", "corrente",
        "力矩", "扭矩", "转矩", "トルク", "토크", "момент", "电流", "電流", "전류", "ток",
    ),
    "q": (
        "q", "qpos", "position", "positions", "pos", "angle", "angles", "theta", "state", "jointangles",
        "winkel", "stellung", "lage", "posicion", "angulo", "posizione", "angolo", "posicao",
        "位置", "角度", "関節角", "위치", "각도", "положение", "угол",
    ),
    "time": (
        "time", "timestamp", "timestamps", "stamp", "t", "sec", "secs", "seconds", "clock", "duration",
        "zeit", "zeitstempel", "messzeit", "tiempo", "temps", "tempo",
        "时间戳", "时间", "時間", "时刻", "時刻", "시간", "время",
    ),
}  # fmt: skip
#: A name with one of these is not what was measured at the joint.
WANTED = {
    "target", "desired", "des", "cmd", "command", "commanded", "ref", "reference", "set", "setpoint", "goal", "action",
    "d", "c", "error", "err", "ext", "external", "hat", "motor", "tcp", "ee", "cartesian", "limit", "max", "min", "var",
    "std", "temperature", "temperatures", "temp", "voltage", "gripper",
    "soll", "sollwert", "ziel", "fehler", "temperatur", "spannung", "greifer", "consigna", "deseada", "deseado",
    "referencia", "temperatura", "consigne", "riferimento", "目标", "期望", "指令", "给定", "目標", "温度", "电压", "夹爪",
}  # fmt: skip
_ALL = {word for words in WORDS.values() for word in words} | WANTED
# A compound ends with what it is: Gelenkwinkel, Istposition. Shorter endings would be found by accident.
_ENDINGS = sorted((word for word in _ALL if len(word) >= 5 and word.isascii()), key=len, reverse=True)
_UNSPACED = sorted((word for word in _ALL if ord(word[0]) > 0x2E80), key=len, reverse=True)


def words_of(name: str) -> list[str]:
    """The words of a name, lower case and without accents: ``joint1Pos_deg`` gives joint, 1, pos, deg.

    Compounds are taken apart where their end is a known word: ``Sollposition1`` gives soll, position, 1, and
    ``关节1角度`` gives 关节, 1, 角度.
    """
    plain = re.sub(r"[\u0300-\u036f]", "", unicodedata.normalize("NFD", name))
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", unicodedata.normalize("NFC", plain))
    found: list[str] = []
    for word in re.findall(r"[^\W\d_]+|[%°]+|\d+", spaced.lower()):
        found += _parts(word)
    return found


def kind_of(words: tuple[str, ...]) -> str | None:
    """The quantity that words name, or None."""
    return next((kind for kind, known in WORDS.items() if any(word in known for word in words)), None)


def wanted(name: str) -> bool:
    """Whether a whole word of a name says that it is not what was measured at a joint; a letter may be the joint's."""
    return any(word in WANTED for word in words_of(name) if len(word) > 1 or not word.isascii())


def _parts(word: str) -> list[str]:
    if word in _ALL or word.isdecimal():
        return [word]
    if not word.isascii():
        inner = next((known for known in _UNSPACED if known in word), None)
        if inner is not None:
            before, _, after = word.partition(inner)
            return [*(_parts(before) if before else []), inner, *(_parts(after) if after else [])]
        return [word]
    end = next((known for known in _ENDINGS if word.endswith(known)), None)
    return [word] if end is None else [*_parts(word[: -len(end)]), end]
