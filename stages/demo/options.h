#pragma once

#include <string>

/// All stages on the synthetic studio: what a caller gives.
namespace mvstudio::stages {

struct DemoOptions {
  std::string out = "demo-out";  ///< folder of the session, which holds the results and the report, too
  bool overwrite = false;
  bool quick = false;
  int cameras = 8;
  std::string size = "640x480";
  std::string lens = "brown5";
  double noise_px = 1.0;
  std::string board = "charuco:7x5:140mm:105mm";
  int board_frames = 60;
  int take_frames = 100;
  int avatar_size = 128;
  int steps = 600;
};

template <class Visitor>
void VisitFields(Visitor&& visit, DemoOptions& o) {
  visit("out", o.out, "folder of the session: footage, results and the report");
  visit("overwrite", o.overwrite, "replace what an earlier demo left in option 'out'");
  visit("quick", o.quick, "a small studio and a short training: ends within a minute, shows no quality");
  visit("cameras", o.cameras, "cameras of the synthetic studio");
  visit("size", o.size, "px; size of the images");
  visit("lens", o.lens, "lens model the images are rendered through");
  visit("noise-px", o.noise_px, "px; noise of the 2D joints, per coordinate");
  visit("board", o.board, "calibration board of the synthetic studio");
  visit("board-frames", o.board_frames, "frames of board footage");
  visit("take-frames", o.take_frames, "frames of the person's take; the last fifth is held out");
  visit("avatar-size", o.avatar_size, "px; size of the avatar's images");
  visit("steps", o.steps, "training steps of the avatar");
}

}  // namespace mvstudio::stages
