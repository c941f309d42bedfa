#include "calib/corners/corner_files.h"
#include "tests/fuzz/fuzz.h"

/// Corner files. What is read must be writable as our own CSV and read back bit for bit.
namespace mvstudio::fuzz {
namespace {

using calib::CornerFile;
using calib::CornerFileOptions;

void RequireSameDetection(const calib::Detection& a, const calib::Detection& b) {
  Require(a.camera_idx == b.camera_idx && a.frame_idx == b.frame_idx && a.board_idx == b.board_idx, "a view changed");
  Require(a.corner_ids == b.corner_ids, "the numbers of corners changed");
  Require(a.points_px == b.points_px, "a point changed");
  Require(a.sigmas_px.size() == b.sigmas_px.size() && a.sigma_px == b.sigma_px, "a sigma changed");
  if (a.sigmas_px.size() > 0) Require(a.sigmas_px == b.sigmas_px, "the sigmas changed");
}

void RequireSound(const CornerFile& file) {
  Require(!file.detections.empty(), "a file without corners was accepted");
  for (const calib::Detection& detection : file.detections) {
    Require(detection.camera_idx >= 0 && detection.camera_idx < static_cast<int>(file.cameras.size()), "no such camera");
    Require(detection.board_idx >= 0 && detection.board_idx < static_cast<int>(file.boards.size()), "no such board");
    const int corners = file.boards[static_cast<size_t>(detection.board_idx)].num_corners();
    for (const int id : detection.corner_ids) Require(id >= 0 && id < corners, "no such corner");
    Require(detection.points_px.allFinite() && detection.points_px.cols() == detection.num_corners(), "not finite");
  }
}

void RunCorners(const std::string& path, const CornerFileOptions& options) {
  CornerFile file;
  if (!Accepts([&] { file = calib::ReadCornerFile(path, options); })) return;
  RequireSound(file);
  const std::string out = MemoryPath("corners-out.csv");
  if (!Accepts([&] { calib::WriteCornerFile(file, out); })) return;
  CornerFile back;
  CornerFileOptions csv;
  csv.format = calib::CornerFormat::kCsv;
  Require(Accepts([&] { back = calib::ReadCornerFile(out, csv); }), "what was written cannot be read");
  Require(back.cameras.size() == file.cameras.size() && back.boards.size() == file.boards.size() &&
              back.detections.size() == file.detections.size(),
          "the numbers of cameras, boards or detections changed");
  for (size_t i = 0; i < file.cameras.size(); ++i) {
    Require(back.cameras[i].name == file.cameras[i].name && back.cameras[i].width_px == file.cameras[i].width_px &&
                back.cameras[i].height_px == file.cameras[i].height_px,
            "a camera changed");
  }
  for (size_t i = 0; i < file.detections.size(); ++i) RequireSameDetection(file.detections[i], back.detections[i]);
}

CornerFileOptions Format(calib::CornerFormat format) {
  CornerFileOptions options;
  options.format = format;
  return options;
}

}  // namespace

MVS_FUZZ_TARGET(corners_vnl, bytes) {
  CornerFileOptions options = Format(calib::CornerFormat::kVnl);
  options.board = calib::ParseBoard("grid:2x2:10mm");
  RunCorners(InMemory("in.vnl", bytes), options);
}

MVS_FUZZ_TARGET(corners_caliscope, bytes) { RunCorners(InMemory("xy.csv", bytes), Format(calib::CornerFormat::kCaliscope)); }

MVS_FUZZ_TARGET(corners_opencv, bytes) { RunCorners(InMemory("in.xml", bytes), Format(calib::CornerFormat::kOpenCv)); }

MVS_FUZZ_TARGET(corners_csv, bytes) { RunCorners(InMemory("in.csv", bytes), Format(calib::CornerFormat::kCsv)); }

}  // namespace mvstudio::fuzz
