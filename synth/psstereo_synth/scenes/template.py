"""A commented scene file to start from."""

__all__ = ["TEMPLATE"]

TEMPLATE = """\
# A synthetic scene. Every table may be left out but [surface]. Lengths are in `unit`, angles (_deg) in degrees.
# Frame: x right, y up, z toward the viewer; the origin is in the middle of the image; shapes fit into -1 ... 1.
name = "my-scene"
summary = "What it tests, in one sentence."
size = [256, 256]                 # width, height [px]
seed = 0
unit = "mm"

[camera]
type = "orthographic"             # looking straight down
width = 2.0                       # what the image's width covers
# type = "pinhole"
# focal = 4.0                     # focal length in widths of the image
# distance = 8.0                  # from the origin

# [[views]]                       # one or more other viewpoints; each gives a capture of its own
# position = [1.0, 0.0, 8.0]
# target = [0.0, 0.0, 0.0]
# up = [0.0, 1.0, 0.0]

[surface]
shape = "hills"                   # plane sphere bowl ellipsoid cone torus vase hills ripples steps cliffs terrain
steepness = 1.5                   # other keys are the shape's own parameters
# elevation = "dem.tif"           # or heights from a file: .npz .npy .tif .asc
# mesh = "bunny.ply"              # or a mesh, fitted into -scale ... scale
# scale = 0.9
# smooth = true                   # with normals interpolated over its triangles

[material]
brdf = "lambert"                  # oren-nayar phong blinn-phong ggx minnaert lunar-lambert merl
# roughness_deg = 17              # of oren-nayar; other keys are the model's own parameters
# file = "gold.binary"            # of brdf = "merl"

[albedo]
pattern = "checker"               # constant gradient checker image
# albedo = 0.7                    # of "constant"; other keys are the pattern's own parameters

[lights]
arrangement = "spiral"            # spiral ring arc day, or `directions` one by one
kind = "directional"              # sun (a disc) led disc window: near ones stand at `distance`
count = 24
tilt_deg = 60                     # largest angle to the view
irradiance = 1000.0               # of a surface at the origin that faces the light [W m-2]; or three, for R, G, B
# azimuth_deg = 0                 # where an arc ends, from right toward up
# directions = [[0.5, 0, 0.8], [-0.5, 0, 0.8], [0, 0.5, 0.8]]
# angular_radius_deg = 0.2666     # of a sun
# distance = 4.0                  # of led, disc, window
# mu = 1.0                        # lobe of a led: 0 all around, 1 flat
# radius = 0.5                    # of a disc
# width = 1.0                     # of a window
# latitude_deg = 40               # of a day of sun: x east, y north
# day = 172                       # of the year
# hours = [6, 18]                 # first and last, apparent solar time

# [ambient]                       # light in every image that light files do not mention
# radiance = 10.0                 # the same from everywhere [W m-2 sr-1]
# environment = "sky.exr"         # or a latitude-longitude map
# harmonics = [1, 0, 0.5, 0, 0, 0, 0, 0, 0]   # or nine coefficients
# dark_frame = true               # an image without the lights comes along

[render]
cast_shadows = true
bounce = 0                        # directions a point in which reflected light is looked for
beams = 64                        # directions for an extended light, where it has to be split
# extinction = 0.0                # of fog [1 / unit]

[sensor]
bits = 16                         # 8 10 12 14 16, or "float"
# white = 300.0                   # radiance at full scale; the scene's brightest value is put at 0.9 if left out
# full_well = 20000               # electrons; brings photon noise
# read_noise = 5                  # electrons
# dark_level = 0.02               # share of full scale
# vignetting = 0.2                # share of light lost in the corners
# gain = 1.0                      # more uses less of the well, like a higher ISO number
# prnu = 0.01                     # how much the pixels' sensitivities differ
# response = "linear"             # "srgb", or the exponent of a gamma curve

# [[faults]]                      # what goes wrong: motion wrong-order light-error duplicate dead-pixels
# fault = "motion"                # ambient-leak blur flicker
# rms = 0.3
"""
"""A scene file with all that can be said in it; it is itself a valid scene."""
