#pragma once

#include <string>

#include "geometry/rig/rig.h"

/// Lenses for images of another resolution or crop of the same sensor.
namespace mvstudio::geometry {

/// Where a pixel of one image is in another of the same sensor. Along each axis, with pixel edges at -0.5:
/// u_new + 0.5 = scale (u_old + 0.5) + offset.
struct PixelMap {
  double scale_x = 1, scale_y = 1;
  double offset_x_px = 0, offset_y_px = 0;
};

/// The camera for images of `width_px` x `height_px` that the map leads to. Focal lengths, principal point and their
/// covariance follow; distortion and pose stay.
RigCamera Resized(const RigCamera& camera, const PixelMap& map, int width_px, int height_px);

/// The same for camera number `camera` of a rig, with the joint covariance.
void ResizeCamera(size_t camera, const PixelMap& map, int width_px, int height_px, Rig* rig);

/// An area of an image, px: columns [x, x + width), rows [y, y + height). It may reach beyond the image.
struct PixelArea {
  int x = 0, y = 0, width_px = 0, height_px = 0;
};

/// The map from an image to `width_px` x `height_px` pixels that show its `area`, whole pixels of it. Each axis has a scale of
/// its own: sizes are rounded to whole pixels.
PixelMap MapOfArea(const PixelArea& area, int width_px, int height_px);

/// True when pixels stay square: the size is that of the area scaled by one factor, up to a rounding of less than a pixel on
/// either axis.
bool KeepsAspect(const PixelArea& area, int width_px, int height_px);

}  // namespace mvstudio::geometry
