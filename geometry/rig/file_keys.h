#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "core/fields.h"

/// Keys of calibration files that say how the numbers beside them are meant.
namespace mvstudio::geometry {

/// Lower case letters and digits alone: `Camera_Model`, `camera-model` and `cameraModel` are one key.
std::string PlainKey(std::string_view key);

/// What a file's words say about the kind of its lens.
enum class LensKind { kUnsaid, kPerspective, kFisheye };
inline constexpr ChoiceWords<LensKind, 3> kLensKinds = {
    {{LensKind::kUnsaid, "auto"}, {LensKind::kPerspective, "perspective"}, {LensKind::kFisheye, "fisheye"}}};
inline std::string_view ToString(LensKind kind) { return WordOf(kLensKinds, kind); }
/// Throws UsageError that names `option`.
inline void FromString(const std::string& text, const std::string& option, LensKind* kind) {
  *kind = KnownChoice(kLensKinds, text, "option '" + option + "' " + text + ": expected auto, perspective or fisheye");
}

/// The kind that keys such as camera_model, distortion_model, is_fisheye state together; words of most programs are known.
/// A projection named pinhole leaves it to the distortion's word, as in Kalibr's files.
class LensWords {
 public:
  /// Whether a key (any spelling) says so.
  static bool IsKey(std::string_view key);
  /// `value`: a word, or 0 and 1 of flags; empty: nothing said. Throws FormatError for a word that is not known, and for one
  /// that contradicts those before.
  void Add(const std::string& path, const std::string& where, std::string_view key, const std::string& value);
  LensKind kind() const { return strong_ != LensKind::kUnsaid ? strong_ : weak_; }

 private:
  LensKind weak_ = LensKind::kUnsaid, strong_ = LensKind::kUnsaid;
  std::string said_by_;
};

/// The keys of a file that its reader does not use.
class UnusedKeys {
 public:
  /// `metres_per_unit`: how the file's lengths are read.
  UnusedKeys(std::string path, double metres_per_unit) : path_(std::move(path)), metres_per_unit_(metres_per_unit) {}

  /// `where`: the key's place; `value`: a number, a word, or JSON of a list or table. Throws FormatError when the key says that
  /// the numbers that were read mean something else: another lens, skew, another unit, axes or pixels.
  void Add(const std::string& where, const std::string& key, const std::string& value);
  /// "rolling_shutter, frames[0].tag (12 times)"; empty: none.
  std::string Text() const;

 private:
  std::string path_;
  double metres_per_unit_;
  struct Seen {
    std::string where;
    int times = 0;
  };
  std::map<std::string, Seen> seen_;  ///< by key
};

}  // namespace mvstudio::geometry
