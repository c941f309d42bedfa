#pragma once

#include <string>

#include "stages/view/marks.h"
#include "stages/view/scene.h"

/// The page that shows frames: four files that name nothing else, and what they ask for.
namespace mvstudio::stages {

const char* ViewPageHtml();    ///< loads view.css, view.js and icon.svg from beside it
const char* ViewPageStyle();   ///< view.css
const char* ViewPageIcon();    ///< icon.svg
const char* ViewPageScript();  ///< view.js; asks for scene.json, step/N.json, marks/C/N.json, image/C/N.jpg, thumb/C/N.jpg,
                               ///< avatar/C/N.png

/// {"title", "kind", "fps_hz", "has_report", "cameras": [{name, width, height, has_footage}], "bones", "detected_bones",
/// "joints": names, "steps": [time step, median rms px or null, joints found, lowest SSIM of held-out images (null: none known,
/// -1: not held out)], "has_masks", "has_body", "has_boards", "has_avatar", "held_out": {time step: {camera: SSIM or null}},
/// "scored": {time step: [camera with scored/C/N.jpg]}}.
std::string ViewSceneJson(const Scene& scene, const MarksReader& marks, bool has_report, bool has_avatar);
/// {"mask", "body", "boards", "x_axes", "y_axes": [[x, y, …] a line]}, px to a tenth.
std::string ViewMarksJson(const ViewMarks& marks);
/// Of each camera: {"frame", "projected": [[x, y, …] a person], "detected": […], "residuals": [[x, y, x, y]], "median_px"}; a
/// joint that is not there is null, null.
std::string ViewStepJson(const Scene& scene, int step);

}  // namespace mvstudio::stages
