#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calib/board/board.h"
#include "calib/formats/length_unit.h"
#include "core/fields.h"

/// Options of ReadCornerFile, which docs/corner-files.md explains. Beside each type stand its words as text: ToString, and
/// FromString that throws UsageError.
namespace mvstudio::calib {

enum class CornerFormat {
  kAuto,  ///< by the file's content
  kVnl,
  kCaliscope,
  kOpenCv,
  kCsv,
};
std::string_view ToString(CornerFormat format);
void FromString(const std::string& text, CornerFormat* format);

/// The images of a camera, by their names: "NAME=PREFIX*SUFFIX"; the star is the frame's number.
struct ImagePattern {
  std::string camera, prefix, suffix;
};
std::string ToString(const ImagePattern& pattern);
void FromString(const std::string& text, ImagePattern* pattern);

/// "NAME=WIDTHxHEIGHT", or without a name for all cameras.
struct CameraSize {
  std::string camera;
  int width_px = 0, height_px = 0;
};
std::string ToString(const CameraSize& size);
void FromString(const std::string& text, CameraSize* size);

struct CornerFileOptions {
  CornerFormat format = CornerFormat::kAuto;
  LengthUnit unit = LengthUnit::kMetre;  ///< of the object points in the file
  std::vector<ImagePattern> cameras;     ///< vnl
  std::vector<CameraSize> sizes;
  std::optional<Board> board;  ///< required for vnl; for the others it replaces the file's own points
};

template <class Visitor>
void VisitFields(Visitor&& visit, CornerFileOptions& o) {
  visit("corners-format", o.format, "auto, vnl (mrcal, mrgingham), caliscope (xy.csv), opencv (XML) or csv (our own)");
  visit("corners-unit", o.unit, "of the board's points in the corner file: m, cm, mm or in");
  visit("corners-camera", o.cameras,
        "vnl: NAME=PATTERN of a camera's image names, with one * for the frame's number; default: by the names cam0-0000.jpg");
  visit("size", o.sizes, "image size WIDTHxHEIGHT px of all cameras, or NAME=WIDTHxHEIGHT, where a corner file does not say");
}

}  // namespace mvstudio::calib
