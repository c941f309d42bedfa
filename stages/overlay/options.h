#pragma once

#include <string>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/view/options.h"

/// Joints, residuals, masks, boards and bodies drawn over footage: what a caller gives.
namespace mvstudio::stages {

/// What is drawn.
struct OverlayMarks {
  bool joints3d = true, joints2d = true, residuals = true, masks = true, boards = true, body = true;
};

struct OverlayOptions {
  ViewSceneOptions scene;
  std::string out;     ///< folder
  std::string frames;  ///< time steps, "90-119"; empty: all
  bool each = false;   ///< a video of each camera instead of one of all
  int tile_px = 640;   ///< longer side of a camera's image
  std::string beside;  ///< folder of renders, CAMERA/*_%08d.png by time step; empty: none
  int num_sheet = 12;  ///< time steps on the contact sheet
  double rate_hz = 0;  ///< of the video; 0: that of the footage
  bool overwrite = false;
  OverlayMarks marks;
};

template <class Visitor>
void VisitFields(Visitor&& visit, OverlayOptions& o) {
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder of the videos and of the contact sheet");
  visit("frames", o.frames, "time steps that are drawn, e.g. 90-119; all unless given");
  VisitStyled(visit, OptionStyle::kSwitch, "each", o.each,
              "a video of each camera, CAMERA.mp4, instead of one with all of them");
  visit("tile-px", o.tile_px, "px; longer side of a camera's image; 0: as large as the footage");
  VisitStyled(visit, OptionStyle::kFolder, "beside", o.beside,
              "folder of images to show right of each camera's, as `avatar render` with option 'frame' camera writes it");
  visit("sheet", o.num_sheet, "time steps on the contact sheet; 0: none is made");
  visit("fps", o.rate_hz, "Hz; frame rate of the video; 0: that of the footage, else 30");
  visit("joints3d", o.marks.joints3d, "3D joints, through the lens: blue and orange");
  visit("joints2d", o.marks.joints2d, "2D joints as they were found: green rings");
  visit("residuals", o.marks.residuals, "lines from the 3D joint to the 2D joint: red");
  visit("masks", o.marks.masks, "outlines of the masks: white");
  visit("boards", o.marks.boards, "boards of a take that films them, where the calibration put them: yellow");
  visit("body", o.marks.body, "the fitted body, through the lens: violet");
  VisitStyled(visit, OptionStyle::kSwitch, "overwrite", o.overwrite, "replace what is at option 'out'");
  VisitFields(visit, o.scene);
}

}  // namespace mvstudio::stages
