#pragma once

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// Fills face_part and face_uv of a template with complete roles and skin weights, in a T- or A-pose: cylindrical charts about
/// the bones, front and back of trunk, arms and legs, left and right of the head, one chart a foot; palm and back of a hand
/// side by side in one chart. No face spans a seam. Where the surface folds over itself as seen from the bone (ears, chin,
/// inside of the mouth), parts of it share their place in the chart.
void BuildTemplateAtlas(BodyTemplate* body);

}  // namespace mvstudio::body
