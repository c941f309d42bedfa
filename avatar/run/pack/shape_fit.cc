#include "avatar/run/pack/shape_fit.h"

#include <algorithm>

#include "avatar/body/mesh_raster.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::avatar {
namespace {

constexpr double kMinGirth = 0.6, kMaxGirth = 1.7;

double ViewIou(const body::BodyTemplate& body, const ShapeView& view) {
  const body::PartUvMap map = body::RasterizeBody(body, body::SkinVertices(body, view.pose), view.camera);
  MVS_CHECK(map.part.size() == view.mask.pixels.size(), "mask of another size than the camera");
  int64_t both = 0, any = 0;
  for (size_t i = 0; i < map.part.size(); ++i) {
    const bool a = map.part[i] > 0, b = view.mask.pixels[i] >= 128;
    both += a && b, any += a || b;
  }
  return any > 0 ? static_cast<double>(both) / static_cast<double>(any) : 1.0;
}

}  // namespace

double TemplateIou(const body::BodyTemplate& body, const std::vector<ShapeView>& views, const RunContext& run) {
  MVS_CHECK(!views.empty(), "no views");
  std::vector<double> iou(views.size());
  ParallelFor(static_cast<int64_t>(views.size()), run.num_threads, [&](int64_t i) { iou[i] = ViewIou(body, views[i]); });
  double sum = 0;
  for (const double value : iou) sum += value;
  return sum / static_cast<double>(views.size());
}

ShapeFit FitShape(const body::BodyTemplate& body, const BodyShape& start, const std::vector<ShapeView>& views,
                  const RunContext& run) {
  ShapeFit fit;
  fit.shape = start;
  fit.iou = fit.iou_before = TemplateIou(ScaleGirth(body, start), views, run);
  const double steps[] = {0.16, 0.08, 0.04, 0.02};
  ProgressStage stage(run, "fitting the body's girth", static_cast<int64_t>(std::size(steps)));
  for (const double step : steps) {
    for (int group = 0; group < kNumGirthGroups; ++group) {
      for (const double direction : {1.0, -1.0}) {
        bool improved = true;
        while (improved) {
          BodyShape trial = fit.shape;
          trial.girth[group] = std::clamp(trial.girth[group] * (1 + direction * step), kMinGirth, kMaxGirth);
          const double iou =
              trial.girth[group] == fit.shape.girth[group] ? 0 : TemplateIou(ScaleGirth(body, trial), views, run);
          improved = iou > fit.iou;
          if (improved) fit.shape = trial, fit.iou = iou;
        }
      }
    }
    stage.Advance();
  }
  return fit;
}

}  // namespace mvstudio::avatar
