#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "avatar/run/references/references.h"
#include "core/check.h"
#include "core/parallel.h"
#include "dataset/views/crop.h"
#include "geometry/rig/alignment.h"

/// Which references an image takes.
namespace mvstudio::avatar {
namespace {

/// RMS distance of about a thousand vertices after a rigid alignment, metres; infinite where there is none.
double PoseDistance(const Eigen::Matrix3Xf& a, const Eigen::Matrix3Xf& b) {
  const Eigen::Index every = a.cols() / 1000 + 1, count = (a.cols() + every - 1) / every;
  Eigen::Matrix3Xd from(3, count), to(3, count);
  for (Eigen::Index i = 0; i < count; ++i)
    from.col(i) = a.col(every * i).cast<double>(), to.col(i) = b.col(every * i).cast<double>();
  const geometry::Alignment alignment = geometry::AlignPoints(from, to);
  return alignment.status == Status::kOk ? alignment.rms : std::numeric_limits<double>::infinity();
}

/// Views of other time steps than the target's.
std::vector<size_t> Allowed(const References& references, const ReferenceTarget& target, int gap) {
  std::vector<size_t> allowed;
  for (size_t v = 0; v < references.views().size(); ++v) {
    const int64_t apart = target.frame ? int64_t{references.views()[v].frame} - *target.frame : int64_t{gap} + 1;
    if (std::abs(apart) > gap) allowed.push_back(v);
  }
  return allowed;
}

/// Pixels of the surface, thinned evenly to about 2000.
std::vector<size_t> SurfacePixels(const body::FaceMap& surface) {
  constexpr size_t kMost = 2000;
  std::vector<size_t> all;
  for (size_t p = 0; p < surface.face.size(); ++p)
    if (surface.face[p] >= 0) all.push_back(p);
  const size_t step = all.size() / kMost + 1;
  std::vector<size_t> some;
  for (size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
  return some;
}

/// What a view is worth at each of the pixels.
std::vector<float> WorthOf(const References& references, size_t v, const ReferenceTarget& target, const body::FaceMap& surface,
                           const std::vector<size_t>& pixels) {
  constexpr double kNearPose = 0.1;  // m
  const double distance = PoseDistance(target.vertices, *references.views()[v].vertices);
  const auto near = static_cast<float>(std::exp(-distance / kNearPose));
  std::vector<float> worth;
  for (const size_t p : pixels) worth.push_back(near * references.Sample(v, surface.face[p], surface.barycentric[p]).cosine);
  return worth;
}

double Gain(const std::vector<float>& worth, const std::vector<float>& best) {
  double gain = 0;
  for (size_t i = 0; i < worth.size(); ++i) gain += std::max(0.f, worth[i] - best[i]);
  return gain;
}

std::vector<size_t> ChooseBest(const References& references, const std::vector<size_t>& allowed, const ReferenceTarget& target,
                               const body::FaceMap& surface, int count) {
  const std::vector<size_t> pixels = SurfacePixels(surface);
  std::vector<std::vector<float>> worth;
  for (const size_t v : allowed) worth.push_back(WorthOf(references, v, target, surface, pixels));
  std::vector<float> best(pixels.size(), 0);
  std::vector<size_t> chosen;
  while (static_cast<int>(chosen.size()) < count) {
    size_t next = allowed.size();
    double most = 0;
    for (size_t i = 0; i < allowed.size(); ++i) {
      const double gain = Gain(worth[i], best);
      if (gain > most) most = gain, next = i;
    }
    if (next == allowed.size()) break;
    for (size_t i = 0; i < best.size(); ++i) best[i] = std::max(best[i], worth[next][i]);
    chosen.push_back(allowed[next]);
  }
  return chosen;
}

std::vector<size_t> ChooseFrontBack(const References& references, const std::vector<size_t>& allowed, int count) {
  if (allowed.empty()) return {};
  const auto faces_less = [&](size_t a, size_t b) { return references.Facing(a) < references.Facing(b); };
  std::vector<size_t> chosen = {*std::max_element(allowed.begin(), allowed.end(), faces_less)};
  const size_t back = *std::min_element(allowed.begin(), allowed.end(), faces_less);
  if (count > 1 && back != chosen.front()) chosen.push_back(back);
  return chosen;
}

}  // namespace

std::vector<size_t> ChooseReferences(const References& references, const ReferenceTarget& target, const body::FaceMap& surface,
                                     const ModelOptions& options) {
  const std::vector<size_t> allowed = Allowed(references, target, options.reference_gap);
  return options.reference_choice == ReferenceChoice::kFrontBack
             ? ChooseFrontBack(references, allowed, options.references)
             : ChooseBest(references, allowed, target, surface, options.references);
}

void FillReferenceRow(const References& references, const ReferenceTarget& target, const ModelOptions& options, int64_t row,
                      at::Tensor& rows) {
  const int64_t size = rows.size(3);
  MVS_CHECK(rows.scalar_type() == at::kByte && rows.is_contiguous() && rows.size(1) == 4 && rows.size(2) == size,
            "references are (N, 4, P, P) bytes");
  const geometry::RigCamera crop = dataset::ResizedCrop(target.crop, static_cast<int>(size));
  const body::FaceMap surface = body::RasterizeFaces(references.body(), target.vertices, crop);
  WarpReferences(references, ChooseReferences(references, target, surface, options), surface,
                 rows.data_ptr<uint8_t>() + row * 4 * size * size);
}

void FillReferences(const References& references, const std::vector<RowView>& views, const ModelOptions& options,
                    int num_threads, AvatarPack* pack) {
  MVS_CHECK(static_cast<int64_t>(views.size()) == pack->size() && pack->template_maps.defined(),
            views.size() << " views of " << pack->size() << " images");
  const int64_t size = pack->template_maps.size(3);
  pack->references = at::zeros({pack->size(), 4, size, size}, at::kByte);
  ParallelFor(pack->size(), num_threads, [&](int64_t i) {
    const RowView& view = views[static_cast<size_t>(i)];
    const auto frame = static_cast<int>(pack->frame.data_ptr<int64_t>()[i]);
    FillReferenceRow(references, {view.crop, *view.vertices, frame}, options, i, pack->references);
  });
}

}  // namespace mvstudio::avatar
