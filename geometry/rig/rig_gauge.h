#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace mvstudio::geometry {

/// What fixes the world frame of a rig, and hence its covariances. Files and messages hold it as a sentence: GaugeText.
struct RigGauge {
  enum class Kind {
    kUnknown,     ///< nobody said
    kImported,    ///< axes of a file whose format does not say
    kLensesOnly,  ///< no world: every camera is in a frame of its own, and the poses are not used
    kCamera,      ///< the world is `camera`
    kBoard,       ///< the first board in frame `frame`
    kSceneBoard,  ///< a board that stood in the images of a scene, in frame `frame` where there are several
    kPoints,      ///< marked points with known places
    kFloor,       ///< the floor under people's feet
    kPanoptic,    ///< a Panoptic dataset's file, `words`
    kOther        ///< `words`
  };

  static RigGauge OfCamera(std::string name) { return {Kind::kCamera, std::move(name)}; }
  static RigGauge OfBoard(int64_t frame) { return {Kind::kBoard, "", frame}; }
  static RigGauge Other(std::string words) { return {Kind::kOther, "", std::nullopt, std::move(words)}; }

  Kind kind = Kind::kUnknown;
  std::string camera = {};
  std::optional<int64_t> frame = std::nullopt;  ///< as in the footage
  std::string words = {};
  std::string distance_to = {};  ///< kCamera: the camera whose stated distance gave the size
  bool stated_lengths = false;   ///< the size is that of stated lengths
  std::string relative_to = {};  ///< text of the gauge of covariances, where the rig was moved since; empty: this one

  bool operator==(const RigGauge& other) const;
  bool operator!=(const RigGauge& other) const { return !(*this == other); }

  /// Whether z is up in this world.
  bool IsUpright() const;
};

inline const RigGauge kLensesOnly{RigGauge::Kind::kLensesOnly};

/// The gauge of a rig that was moved into `world` with covariances that stay relative to what fixed it before.
RigGauge GaugeAfterMove(RigGauge world, const RigGauge& before);

/// "camera 00_00", "board in frame 0", …; empty for kUnknown.
std::string GaugeText(const RigGauge& gauge);
/// Reads every text: one that GaugeText does not make is kOther, so that it is written again as it was.
RigGauge GaugeFromText(const std::string& text);

}  // namespace mvstudio::geometry
