#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/mesh_raster.h"
#include "avatar/data/pack.h"
#include "avatar/run/pack/run_config.h"
#include "avatar/run/references/reference_views.h"
#include "avatar/settings/options.h"

/// Training images warped over the surface into another view and pose: as in Liu et al., "Liquid Warping GAN", ICCV 2019, with
/// the surface's own triangles.
namespace mvstudio::avatar {

/// What a reference shows of one point of the surface.
struct ReferenceSample {
  float cosine = 0;  ///< of the angle between the normal and the line of sight; 0: not seen there
  Eigen::Vector3f colour = Eigen::Vector3f::Zero();  ///< 0..255
};

/// An image into which others are warped.
struct ReferenceTarget {
  geometry::RigCamera crop;   ///< square
  Eigen::Matrix3Xf vertices;  ///< (3, V) metres, world
  std::optional<int> frame;   ///< of the run's own dataset: images of this time step are not used; none: of another take
};

/// Views with what warping needs of each.
class References {
 public:
  /// `body`: of the vertices of the views. Throws ContractViolation where they have other numbers of them.
  References(std::vector<ReferenceView> views, const body::BodyTemplate& body, int num_threads);

  const std::vector<ReferenceView>& views() const { return views_; }
  const body::BodyTemplate& body() const { return body_; }

  /// The point of face `face` in view `v`, bilinearly. It is seen when it lies in front of the camera, in the image and the
  /// mask, at more than 14 degrees from the line of sight, and nothing of the body lies before it.
  ReferenceSample Sample(size_t v, int face, const Eigen::Vector3f& barycentric) const;
  /// Cosine between the direction that the person faces in view `v` and the one to its camera.
  double Facing(size_t v) const { return prepared_[v].facing; }

 private:
  struct Prepared {
    std::vector<Eigen::Vector3f> in_cam;  // (V) metres
    std::vector<float> depth_m;           // (H, W) of the body
    double facing = 0;
  };
  bool SeesPixels(size_t v, const Eigen::Vector2f& px, float nearest_m) const;
  std::vector<ReferenceView> views_;
  body::BodyTemplate body_;
  std::vector<Prepared> prepared_;
};

/// Indices of the views that are warped into `target`, at most options.references, the most useful first. Views whose frame is
/// within options.reference_gap of the target's are never among them.
///
/// best: each view is worth, at a point of the target's visible surface, its cosine there times exp(-d / 0.1 m), d the RMS
/// distance of both bodies' vertices after a rigid alignment. The next view is that which adds most to the mean over the
/// surface of the best worth so far (of equal ones the first), as long as one adds any.
/// frontback: the view that the person faces most, and the one that it is turned away from most.
std::vector<size_t> ChooseReferences(const References& references, const ReferenceTarget& target, const body::FaceMap& surface,
                                     const ModelOptions& options);

/// Fills `out` (4, P, P), P the width of the target's crop: the chosen views' colours, their mean by cosine, on black; and 255
/// where some view shows the point, else 0.
void WarpReferences(const References& references, const std::vector<size_t>& chosen, const body::FaceMap& surface,
                    uint8_t* out);

/// Fills the references of a row.
void FillReferenceRow(const References& references, const ReferenceTarget& target, const ModelOptions& options, int64_t row,
                      at::Tensor& rows);

/// The references of a run whose network takes some, by one thread; null for others. Throws as ReadReferenceViews, and
/// FormatError for a run without a fitted body.
std::shared_ptr<const References> ReadReferences(const std::string& run_folder, const RunConfig& config,
                                                 const ModelOptions& options);

/// pack.references of all rows, at the size of pack.template_maps. `views` as in TrainingSet, of the run's own dataset.
void FillReferences(const References& references, const std::vector<RowView>& views, const ModelOptions& options,
                    int num_threads, AvatarPack* pack);

}  // namespace mvstudio::avatar
