#pragma once

#include <string>
#include <string_view>

#include "core/fields.h"
#include "core/image.h"
#include "core/status.h"
#include "dataset/views/crop.h"
#include "geometry/rig/rig.h"

/// Images as an ideal pinhole camera would have taken them, for readers without our lens models.
namespace mvstudio::dataset {

/// What the pinhole shows.
enum class UndistortView {
  kInside,  ///< the largest view without black borders
  kAll,     ///< every pixel of the footage
  kKeep,    ///< the lens's own focal lengths and principal point
  kCentred  ///< the largest view without black borders whose principal point is the image's centre
};
std::string_view ToString(UndistortView view);  ///< "inside", "all", "keep", "centred"
/// Throws UsageError.
void FromString(const std::string& text, UndistortView* view);

struct UndistortOptions {
  UndistortView view = UndistortView::kInside;
  int width_px = 0;
  int height_px = 0;
  double max_fov_deg = 150;
};

template <class Visitor>
void VisitFields(Visitor&& visit, UndistortOptions& o) {
  visit("undistort-view", o.view,
        "inside: the largest view without black borders; all: every pixel of the footage is shown; keep: the lens's own focal "
        "lengths and principal point; centred: the largest view without black borders about the optical axis");
  visit("undistort-width", o.width_px, "px; 0: that of the footage");
  visit("undistort-height", o.height_px, "px; 0: that of the footage");
  visit("undistort-max-fov", o.max_fov_deg, "degrees; widest field of view of the pinhole along either axis");
}

struct UndistortedCamera {
  /// kOk; kOutsideValidRadius: part of the footage lies beyond the widest field of view, or where the lens has no inverse,
  /// so no such pinhole shows it (the camera is usable all the same). kNonFiniteInput, kDegenerate: there is no such
  /// camera.
  Status status = Status::kOk;
  std::string reason;          ///< one sentence where the status is not kOk
  geometry::RigCamera camera;  ///< pinhole of the same name, position and orientation; no covariances
  double lost_share = 0;       ///< fraction of the footage's pixels that this view does not show
  double empty_share = 0;      ///< fraction of the pinhole's pixels without a source
  bool usable() const { return status == Status::kOk || status == Status::kOutsideValidRadius; }
};

/// True when the principal point is the centre of the image to a millionth of a pixel.
bool IsCentred(const geometry::Camera& camera);

/// The pinhole for a camera of any lens model. A pinhole of the wanted size is returned unchanged, but for "centred" where
/// its principal point is elsewhere. Throws UsageError for sizes outside 1 … 32768.
UndistortedCamera IdealPinhole(const geometry::RigCamera& source, const UndistortOptions& options = {});

/// Resamples all images of one camera; copies share the map. Colours are means over the part of a pixel's footprint that
/// has a source; pixels without a source are 0.
class Undistorter {
 public:
  /// `pinhole` as from IdealPinhole, or any pinhole at the same position.
  Undistorter(const geometry::RigCamera& source, const geometry::RigCamera& pinhole);
  Image Apply(const Image& source, int num_threads = 1) const;
  /// 255 where at least half of the pixel's footprint is foreground.
  Image Mask(const Image& source, int num_threads = 1) const;
  /// 255 where at least half of the pixel's footprint lies in the footage.
  const Image& Validity() const { return validity_; }
  const ResampleMap& map() const { return map_; }

 private:
  ResampleMap map_;
  Image validity_;
};

/// Errors of an undistortion.
struct UndistortionError {
  double max_joint_px = 0;  ///< footage px: projections by the lens against projections by the pinhole looked up in the
                            ///< footage; over a grid of visible points
  double max_map_px = 0;    ///< footage px: the same through the map that images are resampled with
  double psnr_db = 0;       ///< of a seeded band-limited image resampled there and back, where both have a source; NaN: nowhere
  double finest_px = 0;     ///< shortest period of that image
};
/// With `with_image` false, psnr_db stays NaN and the call takes milliseconds instead of a second.
UndistortionError MeasureUndistortion(const geometry::RigCamera& source, const geometry::RigCamera& pinhole, uint64_t seed = 1,
                                      bool with_image = true);

}  // namespace mvstudio::dataset
