#include "avatar/run/surface/network_training.h"

#include <algorithm>
#include <cmath>

#include "avatar/body/fit/offsets.h"
#include "avatar/run/surface/silhouette_function.h"
#include "avatar/run/surface/trained_net.h"
#include "avatar/train/adam.h"
#include "core/parallel.h"
#include "core/progress.h"

namespace mvstudio::avatar {
namespace {

constexpr int kWarmUpSteps = 20;

at::Tensor IndexTensor(const std::vector<int64_t>& values) { return at::tensor(values, at::kLong); }

/// (V, V) sparse.
at::Tensor LaplacianTensor(const body::BodyTemplate& body) {
  const Eigen::SparseMatrix<double> laplacian = body::UmbrellaLaplacian(body.vertices, body.faces);
  std::vector<int64_t> rows, columns;
  std::vector<float> values;
  for (Eigen::Index c = 0; c < laplacian.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(laplacian, c); it; ++it)
      rows.push_back(it.row()), columns.push_back(c), values.push_back(static_cast<float>(it.value()));
  }
  const int64_t count = laplacian.cols();
  return at::sparse_coo_tensor(at::stack({IndexTensor(rows), IndexTensor(columns)}), at::tensor(values), {count, count})
      .coalesce();
}

double RateAt(const NetworkTrainingOptions& options, int i) {
  const double left = 1 - static_cast<double>(i) / options.steps;
  return options.learning_rate * std::min({1.0, (i + 1.0) / kWarmUpSteps, 2 * left});
}

}  // namespace

/// What all networks of a body share.
struct NetworkTraining::Surface {
  body::OffsetAtlas atlas;
  body::OffsetSmoother smoother;
  at::Tensor laplacian, edge_from, edge_to, edge_length;  // (3 F) each once a face

  explicit Surface(const body::BodyTemplate& of)
      : atlas(MakeOffsetAtlas(of)), smoother(of, body::kOffsetNetStiffness), laplacian(LaplacianTensor(of)) {
    std::vector<int64_t> from, to;
    std::vector<float> length;
    for (Eigen::Index f = 0; f < of.faces.cols(); ++f) {
      for (int k = 0; k < 3; ++k) {
        const int a = of.faces(k, f), b = of.faces((k + 1) % 3, f);
        from.push_back(a), to.push_back(b);
        length.push_back(std::max(1e-4f, (of.vertices.col(a) - of.vertices.col(b)).norm()));
      }
    }
    edge_from = IndexTensor(from), edge_to = IndexTensor(to), edge_length = at::tensor(length).unsqueeze(1);
  }

  at::Tensor Regularity(const at::Tensor& offsets, const NetworkTrainingOptions& options) const {
    const at::Tensor rough = at::mm(laplacian, offsets).pow(2).sum(1).mean();
    const at::Tensor strain = (offsets.index_select(0, edge_from) - offsets.index_select(0, edge_to)) / edge_length;
    return options.laplacian * rough + options.strain * strain.pow(2).sum(1).mean() +
           options.size * offsets.abs().sum(1).mean();
  }
};

NetworkTraining::NetworkTraining(const body::TakeOutlines& take, const NetworkTrainingOptions& options, const RunContext& run)
    : take_(take), options_(options), run_(run), surface_(std::make_shared<Surface>(take.body)) {}
NetworkTraining::~NetworkTraining() = default;

at::Tensor NetworkTraining::Loss(const at::Tensor& offsets, const body::PosedStep& step, Rng* rng) const {
  SilhouetteViews views{&take_, &step, {}, options_.soft};
  for (int k = 0; k < static_cast<int>(step.used.size()); ++k) {
    if (step.used[k]) views.views.push_back(k);
  }
  while (static_cast<int>(views.views.size()) > options_.views_per_step)
    views.views.erase(views.views.begin() + rng->Index(static_cast<int64_t>(views.views.size())));
  return options_.silhouette * SilhouetteOfOffsets(offsets, views) + surface_->Regularity(offsets, options_);
}

std::shared_ptr<const body::OffsetNet> NetworkTraining::Train(const std::vector<int>& indices) const {
  at::set_num_threads(ResolveThreads(run_.num_threads));
  std::vector<Eigen::Matrix3Xf> posed;
  for (const int i : indices) posed.push_back(PosedAboutRoot(take_.body, ToBodyPose(take_.body, take_.steps[i].seen)));
  TrainedNet net(surface_->atlas, surface_->smoother, options_.net, NormOf(surface_->atlas, posed), options_.seed);
  Adam adam;
  for (auto& [name, value] : net.parameters()) adam.Add(name, value);
  Rng rng(options_.seed);
  for (int i = 0; i < options_.steps; ++i) {
    if (run_.progress && run_.progress->Cancelled()) throw CancelledError("interrupted");
    const int64_t at = rng.Index(static_cast<int64_t>(indices.size()));
    adam.ClearGradients();
    Loss(net.Forward(posed[at]), take_.steps[indices[at]], &rng).backward();
    if (std::isfinite(adam.GradientNorm())) adam.Step(RateAt(options_, i));
  }
  return std::make_shared<body::OffsetNet>(take_.body, net.Arrays());
}

body::OffsetTrainer NetworkTrainer(const body::TakeOutlines& take, const NetworkTrainingOptions& options,
                                   const RunContext& run) {
  const auto training = std::make_shared<NetworkTraining>(take, options, run);
  return {"a network's offsets", [training](const std::vector<int>& indices) {
            return std::optional(body::TrainedOffsets{std::nullopt, training->Train(indices)});
          }};
}

}  // namespace mvstudio::avatar
