"""Ways in which a capture on disk can be unusable, and the words that must be in the message."""

import shutil

import numpy as np

from tests.cli.capture_files import keep_images, lights_of, read_png, save_png, write_lights


def missing_image(folder):
    (folder / "003.png").unlink()


def truncated_image(folder):
    data = (folder / "003.png").read_bytes()
    (folder / "003.png").write_bytes(data[: len(data) // 2])


def truncated_by_a_little(folder):
    data = (folder / "003.png").read_bytes()
    (folder / "003.png").write_bytes(data[:-6])


def corrupt_image(folder):
    data = bytearray((folder / "003.png").read_bytes())
    middle = len(data) // 2
    data[middle : middle + 16] = bytes(b ^ 0xFF for b in data[middle : middle + 16])
    (folder / "003.png").write_bytes(bytes(data))


def corrupt_first_image(folder):
    corrupt_image_data = bytearray((folder / "001.png").read_bytes())
    corrupt_image_data[200:216] = bytes(16)
    (folder / "001.png").write_bytes(bytes(corrupt_image_data))


def empty_image(folder):
    (folder / "003.png").write_bytes(b"")


def text_as_image(folder):
    (folder / "003.png").write_text("This is no picture.")


def other_size(folder):
    save_png(folder / "003.png", read_png(folder / "003.png")[:-1])


def other_depth(folder):
    save_png(folder / "003.png", (read_png(folder / "003.png") // 257).astype(np.uint8))


def other_channels(folder):
    save_png(folder / "003.png", read_png(folder / "003.png")[..., 0])


def two_lights(folder):
    keep_images(folder, 2)


def one_light(folder):
    keep_images(folder, 1)


def coplanar_lights(folder):
    rows = lights_of(folder)
    rows[:, 1] = 0.25 * rows[:, 0]
    write_lights(folder, rows)


def equal_lights(folder):
    write_lights(folder, np.repeat(lights_of(folder)[:1], 8, axis=0))


def zero_light(folder):
    rows = lights_of(folder)
    rows[4] = 0
    write_lights(folder, rows)


def nan_light(folder):
    rows = lights_of(folder)
    rows[4, 1] = np.nan
    write_lights(folder, rows)


def infinite_light(folder):
    rows = lights_of(folder)
    rows[4, 1] = np.inf
    write_lights(folder, rows)


def zero_strength(folder):
    rows = np.loadtxt(folder / "light_intensities.txt")
    rows[4] = 0
    write_lights(folder, rows, "light_intensities.txt")


def black_images(folder):
    for path in folder.glob("0*.png"):
        save_png(path, np.zeros((40, 48, 3), np.uint16))


def one_black_image(folder):
    save_png(folder / "003.png", np.zeros((40, 48, 3), np.uint16))


def empty_mask(folder):
    save_png(folder / "mask.png", np.zeros((40, 48), np.uint8))


def other_mask(folder):
    save_png(folder / "mask.png", np.full((48, 40), 255, np.uint8))


def damaged_mask(folder):
    (folder / "mask.png").write_bytes((folder / "mask.png").read_bytes()[:60])


def too_few_lights(folder):
    write_lights(folder, lights_of(folder)[:7])


def too_many_lights(folder):
    write_lights(folder, np.vstack([lights_of(folder), [[0, 0, 1]]]))


def too_few_strengths(folder):
    write_lights(folder, np.loadtxt(folder / "light_intensities.txt")[:7], "light_intensities.txt")


def name_taken_out(folder):
    names = (folder / "filenames.txt").read_text().split()
    (folder / "filenames.txt").write_text("\n".join(names[:-1]) + "\n")


def binary_lights(folder):
    (folder / "light_directions.txt").write_bytes(bytes(range(256)) * 4)


def word_in_lights(folder):
    lines = (folder / "light_directions.txt").read_text().splitlines()
    lines[5] = "0.1 oops 0.9"
    (folder / "light_directions.txt").write_text("\n".join(lines) + "\n")


def short_row(folder):
    lines = (folder / "light_directions.txt").read_text().splitlines()
    lines[5] = "0.1 0.9"
    (folder / "light_directions.txt").write_text("\n".join(lines) + "\n")


def empty_lights(folder):
    (folder / "light_directions.txt").write_text("")


def no_lights(folder):
    for name in ("light_directions.txt", "light_intensities.txt", "filenames.txt"):
        (folder / name).unlink()


def empty_folder(folder):
    shutil.rmtree(folder)
    folder.mkdir()


def no_folder(folder):
    shutil.rmtree(folder)


def file_as_folder(folder):
    shutil.rmtree(folder)
    folder.write_text("just a file")


def folder_of_captures(folder):
    inner = folder / "inner"
    inner.mkdir()
    for path in [p for p in folder.iterdir() if p.is_file()]:
        path.rename(inner / path.name)


def toml(text):
    def spoil(folder):
        (folder / "capture.toml").write_text(text)

    return spoil


BAD = {
    "missing image": (missing_image, ("003.png",)),
    "truncated image": (truncated_image, ("003.png",)),
    "image without its end": (truncated_by_a_little, ("003.png",)),
    "corrupt image": (corrupt_image, ("003.png",)),
    "corrupt first image": (corrupt_first_image, ("001.png",)),
    "empty image": (empty_image, ("003.png", "empty")),
    "text as image": (text_as_image, ("003.png",)),
    "other size": (other_size, ("003.png", "48 × 39", "48 × 40", "001.png")),
    "other depth": (other_depth, ("003.png", "8 bit", "16 bit")),
    "other channels": (other_channels, ("003.png", "1 channel", "3 channels")),
    "two lights": (two_lights, ("2 lights", "Three or more")),
    "one light": (one_light, ("1 light", "Three or more")),
    "coplanar lights": (coplanar_lights, ("one plane",)),
    "equal lights": (equal_lights, ("one plane",)),
    "zero light": (zero_light, ("light_directions.txt", "Light 5", "zero")),
    "nan light": (nan_light, ("light_directions.txt", "Light 5", "nan")),
    "infinite light": (infinite_light, ("light_directions.txt", "Light 5", "inf")),
    "zero strength": (zero_strength, ("light_intensities.txt", "Light 5")),
    "black images": (black_images, ("All images are black",)),
    "one black image": (one_black_image, ("003.png", "black")),
    "empty mask": (empty_mask, ("mask.png", "empty")),
    "other mask": (other_mask, ("mask.png", "40 × 48", "48 × 40")),
    "damaged mask": (damaged_mask, ("mask.png",)),
    "too few lights": (too_few_lights, ("light_directions.txt", "7", "8 images")),
    "too many lights": (too_many_lights, ("light_directions.txt", "9", "8 images")),
    "too few strengths": (too_few_strengths, ("light_intensities.txt", "7", "8 images")),
    "too few names": (name_taken_out, ("8", "7 images")),
    "binary lights": (binary_lights, ("light_directions.txt",)),
    "word in the lights": (word_in_lights, ("Line 6", "light_directions.txt", "oops")),
    "short row of lights": (short_row, ("Line 6", "light_directions.txt", "0.1 0.9")),
    "empty lights": (empty_lights, ("light_directions.txt",)),
    "no lights": (no_lights, ("light directions", "capture.toml")),
    "empty folder": (empty_folder, ("0 images", "no file of lights")),
    "no folder": (no_folder, ("does not exist",)),
    "file as folder": (file_as_folder, ("file",)),
    "folder of captures": (folder_of_captures, ("inner",)),
    "unknown key": (
        toml('[images]\npattern = "0*.png"\n[lights]\ndirectons = "light_directions.txt"\n'),
        ("directons", "directions", "capture.toml"),
    ),
    "no toml": (toml("[images\n"), ("capture.toml", "TOML")),
    "toml without lights": (toml('[images]\npattern = "0*.png"\n'), ("no lights",)),
    "toml with a wrong type": (toml("[images]\npattern = 7\n[lights]\nangles = [[0, 60]]\n"), ("pattern",)),
}
