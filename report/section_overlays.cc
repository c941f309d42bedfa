#include <algorithm>
#include <cmath>
#include <set>

#include "core/statistics.h"
#include "report/page/format.h"
#include "report/page/image.h"
#include "report/sections.h"
#include "report/svg/svg.h"

/// Observed points and their residuals on the images they were found in.
namespace mvstudio::report {
namespace {

constexpr size_t kMaxPoints = 2000;  // of one image

/// [x, y, width, height] in pixels of the frame; a figure is as wide or as high as all others.
void ReadBox(const Value& box, ImageOverlaySpec* spec) {
  spec->left_px = box.At(0).Number() - 0.5, spec->top_px = box.At(1).Number() - 0.5;
  spec->width_px = box.At(2).Number(), spec->height_px = box.At(3).Number();
  spec->width = std::min(spec->width, spec->width * spec->width_px / spec->height_px);
}

/// Points [x, y, dx, dy, flag] px; those whose flag is not 0 are rejected.
void ReadPoints(const Value& list, ImageOverlaySpec* spec) {
  for (size_t i = 0; i < std::min(kMaxPoints, list.items().size()); ++i) {
    const Value& item = list.items()[i];
    const ImageArrow point{item.At(0).Number(), item.At(1).Number(), item.At(2).Number(), item.At(3).Number()};
    (item.At(4).Number(0) == 0 ? spec->points : spec->rejected).push_back(point);
  }
}

/// The image of a view; empty when there is none or it cannot be embedded.
std::string ReadViewImage(SectionContext* context, const Stage& stage, const Value& view) {
  if (!view["picture"].IsText()) return {};
  return ReadOutput(
      context, stage, Value::Object().Set("path", view["picture"]),
      [](std::string_view bytes) { return !ImageType(bytes).empty(); }, "neither PNG nor JPEG");
}

/// The figure of a view, marked so that the page's viewer finds the image of a camera in it.
std::string ViewFigure(const Value& view, const std::string& figure, const std::string& caption) {
  const Value& box = view["box_px"];
  std::string place;
  for (size_t i = 0; i < 4; ++i) place += (i > 0 ? " " : "") + FormatNumber(box.At(i).Number(), 9);
  return FigureHtml(
      "<div data-camera=\"" + EscapeHtml(view["camera"].Text()) + "\" data-box=\"" + place + "\">" + figure + "</div>",
      caption);
}

std::string FrameText(const Value& view) { return "frame " + FormatNumber(view["frame"].Number(), 9); }

std::string BoardView(SectionContext* context, const Stage& stage, const Value& view) {
  ImageOverlaySpec spec;
  const bool worst = view["kind"].Text() == "worst";
  spec.title = view["camera"].Text("?") + ", " + FrameText(view) + (worst ? ": largest residuals" : ": an ordinary view");
  ReadBox(view["box_px"], &spec);
  spec.enlarge = true;
  ReadPoints(view["corners"], &spec);
  const std::string image = ReadViewImage(context, stage, view);
  spec.image = image;
  const std::string figure = ImageOverlay(spec);
  if (figure.empty()) return {};
  std::string caption = FormatCount(static_cast<double>(spec.points.size())) + " corners, rms " +
                        FormatWithUnit(view["rms_px"].Number(), "px", 3);
  if (!spec.rejected.empty()) caption += "; " + FormatCount(static_cast<double>(spec.rejected.size())) + " rejected (crosses)";
  return ViewFigure(view, figure, caption + (image.empty() ? "; the image itself is not at hand." : "."));
}

/// Joints [x, y of the projection, x, y of the keypoint] px of several persons, `num_joints` each.
void ReadJoints(const Value& joints, const Value& bones, size_t num_joints, ImageOverlaySpec* spec) {
  const size_t count = std::min(kMaxPoints, joints.items().size());
  const auto projected = [&](size_t i) { return ImagePoint{joints.At(i).At(0).Number(), joints.At(i).At(1).Number()}; };
  for (size_t i = 0; i < count; ++i) {
    const double x = joints.At(i).At(2).Number(), y = joints.At(i).At(3).Number();
    spec->points.push_back({x, y, x - projected(i).x, y - projected(i).y});
  }
  for (size_t first = 0; num_joints > 0 && first + num_joints <= count; first += num_joints) {
    for (const Value& bone : bones.items()) {
      const double a = bone.At(0).Number(), b = bone.At(1).Number(), end = static_cast<double>(num_joints);
      if (!(a >= 0 && a < end && b >= 0 && b < end)) continue;
      spec->bones.emplace_back(projected(first + static_cast<size_t>(a)), projected(first + static_cast<size_t>(b)));
    }
  }
}

std::string TakeOverlay(SectionContext* context, const Stage& stage, const Value& view) {
  ImageOverlaySpec spec;
  const bool in_footage = view["frame"].IsNumber();
  spec.title = view["camera"].Text("?") + ", " +
               (in_footage ? FrameText(view) : "time step " + FormatNumber(view["instant"].Number(), 9));
  ReadBox(view["box_px"], &spec);
  const Value& overlays = stage.metrics()["overlays"];
  ReadJoints(view["joints"], overlays["bones"], static_cast<size_t>(std::max(0.0, overlays["num_joints"].Number(0))), &spec);
  const std::string image = ReadViewImage(context, stage, view);
  spec.image = image;
  const std::string figure = ImageOverlay(spec);
  if (figure.empty()) return {};
  return ViewFigure(view, figure,
                    "median distance " + FormatWithUnit(view["median_px"].Number(), "px", 3) + ", largest " +
                        FormatWithUnit(view["max_px"].Number(), "px", 3) + ", " + FormatCount(view["num_points"].Number()) +
                        " keypoints" + (image.empty() ? "; the image itself is not at hand." : "."));
}

size_t NumCameras(const Value& views) {
  std::set<std::string> names;
  for (const Value& view : views.items()) names.insert(view["camera"].Text());
  return names.size();
}

void AddFigure(std::string figure, std::vector<std::string>* figures) {
  if (!figure.empty()) figures->push_back(std::move(figure));
}

}  // namespace

std::string BoardViews(SectionContext* context, const Stage& stage) {
  const Value& views = stage.metrics()["board_views"];
  std::vector<std::string> figures;
  for (const Value& view : views.items()) AddFigure(BoardView(context, stage, view), &figures);
  return CameraFigures("Boards with corners",
                       "Ring: a corner as it was found. Arrow: its residual (observed minus projected), enlarged by the stated "
                       "factor. Of each camera an ordinary view and the one with the largest residuals.",
                       figures, NumCameras(views), "grid small");
}

std::string TakeOverlays(SectionContext* context, const Stage& stage) {
  const Value& overlays = stage.metrics()["overlays"];
  std::vector<std::string> figures;
  for (const Value& view : overlays["views"].items()) AddFigure(TakeOverlay(context, stage, view), &figures);
  return CameraFigures("3D joints over the images",
                       "Blue: the 3D joints projected into the image. Ring: the keypoint that was found there; the red line "
                       "from the projection to it is the distance, not enlarged.",
                       figures, NumCameras(overlays["views"]), "grid small");
}

}  // namespace mvstudio::report
