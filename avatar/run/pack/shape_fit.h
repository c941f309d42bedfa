#pragma once

#include <vector>

#include "avatar/run/pack/body_shape.h"
#include "core/image.h"
#include "core/progress.h"
#include "geometry/rig/rig.h"

namespace mvstudio::avatar {

/// One silhouette to fit: a pose, the camera, and the person's mask in its image (255 inside).
struct ShapeView {
  body::BodyPose pose;
  geometry::RigCamera camera;
  Image mask;  // (H, W, 1)
};

struct ShapeFit {
  BodyShape shape;
  double iou_before = 0;  ///< mean IoU with the template unchanged (or as given)
  double iou = 0;         ///< mean IoU with the fitted girths
};

/// Mean intersection over union of the posed template's silhouette and the masks.
double TemplateIou(const body::BodyTemplate& body, const std::vector<ShapeView>& views, const RunContext& run);

/// Girth of each group, 0.6 to 1.7, that maximises TemplateIou: cyclic search with halved steps, from `start`.
ShapeFit FitShape(const body::BodyTemplate& body, const BodyShape& start, const std::vector<ShapeView>& views,
                  const RunContext& run);

}  // namespace mvstudio::avatar
