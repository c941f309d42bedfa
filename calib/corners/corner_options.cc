#include "calib/corners/corner_options.h"

#include <tuple>

#include "calib/corners/corner_readers.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

constexpr ChoiceWords<CornerFormat, 5> kCornerFormats = {{{CornerFormat::kAuto, "auto"},
                                                          {CornerFormat::kVnl, "vnl"},
                                                          {CornerFormat::kCaliscope, "caliscope"},
                                                          {CornerFormat::kOpenCv, "opencv"},
                                                          {CornerFormat::kCsv, "csv"}}};

}  // namespace

std::string_view ToString(CornerFormat format) { return WordOf(kCornerFormats, format); }

void FromString(const std::string& text, CornerFormat* format) {
  *format =
      KnownChoice(kCornerFormats, text, "option 'corners-format' '" + text + "': expected auto, vnl, caliscope, opencv or csv");
}

std::string ToString(const ImagePattern& pattern) { return pattern.camera + "=" + pattern.prefix + "*" + pattern.suffix; }

void FromString(const std::string& text, ImagePattern* pattern) {
  const size_t equals = text.find('='), star = text.find('*');
  if (equals == std::string::npos || equals == 0 || star == std::string::npos || star < equals ||
      text.find('*', star + 1) != std::string::npos) {
    throw UsageError("option 'corners-camera' '" + text + "': expected NAME=PATTERN with one *, e.g. left=left*.jpg");
  }
  *pattern = {text.substr(0, equals), text.substr(equals + 1, star - equals - 1), text.substr(star + 1)};
}

std::string ToString(const CameraSize& size) {
  const std::string pixels = std::to_string(size.width_px) + "x" + std::to_string(size.height_px);
  return size.camera.empty() ? pixels : size.camera + "=" + pixels;
}

void FromString(const std::string& text, CameraSize* size) {
  const size_t equals = text.rfind('=');
  CameraSize read;
  if (equals != std::string::npos) read.camera = text.substr(0, equals);
  std::tie(read.width_px, read.height_px) =
      internal::ParseSize(equals == std::string::npos ? text : text.substr(equals + 1), "option 'size'");
  *size = read;
}

}  // namespace mvstudio::calib
