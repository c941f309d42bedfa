#include "avatar/body/body_template.h"
#include "core/check.h"

namespace mvstudio::body {

BodyTemplate WithShape(const BodyTemplate& body, const Eigen::VectorXd& coefficients) {
  const BlendShapes& shapes = body.shapes;
  MVS_CHECK(coefficients.size() == static_cast<Eigen::Index>(shapes.names.size()),
            coefficients.size() << " coefficients for " << shapes.names.size() << " shapes");
  BodyTemplate shaped = body;
  if (coefficients.size() == 0) return shaped;
  shaped.vertices.reshaped() += shapes.vertices * coefficients.cast<float>();
  shaped.bone_heads.reshaped() += shapes.heads * coefficients;
  shaped.bone_tails.reshaped() += shapes.tails * coefficients;
  shaped.coco19.reshaped() += shapes.coco19 * coefficients;
  return shaped;
}

}  // namespace mvstudio::body
