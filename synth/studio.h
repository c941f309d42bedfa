#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "core/fields.h"
#include "geometry/rig/rig.h"

namespace mvstudio::synth {

enum class Arrangement { kRing, kDome };
enum class FootageFormat { kMp4, kPng };                ///< H.264, or lossless folders of images
enum class Background { kTextured, kPlain, kPosters };  ///< kPosters: walls full of features
/// kSkinned: linear blend skinning explains the person; kCloth: muscles swell, and a skirt and the hem of a shirt swing.
enum class SubjectKind { kSkinned, kCloth };
enum class TakeMotion { kWalk, kATurn };  ///< kATurn: once around on the spot in A-pose

std::string_view ToString(Arrangement arrangement);  ///< "ring", "dome"
std::string_view ToString(FootageFormat format);     ///< "mp4", "png"
std::string_view ToString(Background background);    ///< "textured", "plain", "posters"
std::string_view ToString(SubjectKind subject);      ///< "skinned", "cloth"
std::string_view ToString(TakeMotion motion);        ///< "walk", "a-turn"
/// Throw UsageError.
void FromString(const std::string& text, Arrangement* arrangement);
void FromString(const std::string& text, FootageFormat* format);
void FromString(const std::string& text, Background* background);
void FromString(const std::string& text, SubjectKind* subject);
void FromString(const std::string& text, TakeMotion* motion);

/// The synthetic studio and its recordings. The seed is that of the run.
struct SynthOptions {
  int cameras = 8;        ///< number of cameras
  double radius_m = 3;    ///< m, horizontal distance of the cameras from the centre (dome: distance)
  double height_m = 1.6;  ///< m, mean height of the cameras of a ring; they alternate 0.65 m above and below
  Arrangement arrangement = Arrangement::kRing;
  std::string size = "640x480";                   ///< image size, WIDTHxHEIGHT, even numbers
  std::string lens = "brown5";                    ///< any lens model
  double focal_px = 0;                            ///< px; 0: a 2.4 m tall subject at the centre fills the image
  double noise_px = 0.2;                          ///< px, standard deviation of the 2D joints per coordinate
  std::string board = "charuco:7x5:140mm:105mm";  ///< board that is waved; its markers must stay above about 15 px
  int board_frames = 60;                          ///< frames of board footage; 0: none
  int take_frames = 100;                          ///< frames of person footage; 0: none
  double fps = 25;                                ///< Hz, frame rate of all footage
  double person_height_m = 1.75;                  ///< m
  int samples = 3;                                ///< samples along a pixel's side for the person (the board gets 2 more)
  int texture_px = 256;                           ///< px, side of each chart of the person's texture
  FootageFormat format = FootageFormat::kMp4;
  int crf = 12;  ///< H.264 quality: 0 lossless ... 51 worst
  Background background = Background::kTextured;
  SubjectKind subject = SubjectKind::kSkinned;
  std::string body;  ///< body.npz, MakeHuman's folder or a file in SMPL's layout; empty: the mannequin
  TakeMotion take_motion = TakeMotion::kWalk;
  int new_motion_frames = 0;  ///< frames of another walk after the take's; cut

  int all_take_frames() const { return take_frames + new_motion_frames; }
};

template <class Visitor>
void VisitFields(Visitor&& visit, SynthOptions& o) {
  visit("cameras", o.cameras, "number of cameras");
  visit("radius-m", o.radius_m, "m, distance of the cameras from the centre of the studio");
  visit("height-m", o.height_m, "m, mean height of a ring's cameras; they alternate 0.65 m above and below");
  visit("arrangement", o.arrangement, "ring or dome");
  visit("size", o.size, "image size, WIDTHxHEIGHT, even numbers");
  visit("lens", o.lens, "pinhole, brown1, brown2, brown4, brown5, rational8 or kannala4");
  visit("focal-px", o.focal_px, "px; 0: 2.4 m at the centre fill the image's height");
  visit("noise-px", o.noise_px, "px, standard deviation of the 2D joints per coordinate");
  visit("board", o.board, "board that is waved through the volume");
  visit("board-frames", o.board_frames, "frames of board footage; 0: none");
  visit("take-frames", o.take_frames, "frames of person footage; 0: none");
  visit("fps", o.fps, "Hz, frame rate of all footage");
  visit("person-height-m", o.person_height_m, "m, height of the person; a body that is given has its own");
  visit("samples", o.samples, "samples along a pixel's side, 1 to 8; fewer is faster");
  visit("texture-px", o.texture_px, "px, side of each of the 24 charts of the person's texture");
  visit("format", o.format, "footage as mp4 (H.264) or png (lossless, image folders)");
  visit("crf", o.crf, "H.264 quality: 0 lossless ... 51 worst");
  visit("background", o.background, "textured, plain, or posters: walls full of features (for calibrate option 'from-scene')");
  visit("subject", o.subject, "skinned, or cloth: muscles swell, a skirt and the hem of a shirt swing");
  visit("body", o.body, "the person: a fitted body.npz, MakeHuman's folder, or a file in SMPL's layout; empty: the mannequin");
  visit("take-motion", o.take_motion, "walk, or a-turn: once around on the spot in A-pose; takes 4 s or longer");
  visit("new-motion-frames", o.new_motion_frames, "frames of another walk that follow in the same take, after a cut");
}

/// Throws UsageError that names the option and what was expected.
void Validate(const SynthOptions& options);

/// Width and height of `size`.
std::pair<int, int> ParseSize(const std::string& size);

/// Cameras cam_01 … looking at (0, 0, 1 m), each with slightly different intrinsics and position. World: z up, floor at z
/// = 0.
geometry::Rig MakeStudio(const SynthOptions& options, uint64_t seed);

}  // namespace mvstudio::synth
