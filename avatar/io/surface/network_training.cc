#include "avatar/io/surface/network_training.h"

#include <torch/torch.h>

#include <algorithm>
#include <cmath>

#include "avatar/io/surface/silhouette_function.h"
#include "avatar/train/adam.h"
#include "body/fit/offsets.h"
#include "body/texture/texel_map.h"
#include "core/random.h"

namespace mvstudio::avatar {
namespace {

constexpr int kTilePx = 16, kColumns = 6, kRows = 4;
static_assert(kColumns * kRows == body::kNumParts, "a tile for each chart");

at::Tensor ToTensor(const std::vector<int64_t>& values) { return at::tensor(values, at::kLong); }

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
  return at::sparse_coo_tensor(at::stack({ToTensor(rows), ToTensor(columns)}), at::tensor(values), {count, count}).coalesce();
}

/// Where the atlas shows each vertex, by its first corner: (V, 2) as grid_sample takes it.
at::Tensor VertexGrid(const body::BodyTemplate& body) {
  at::Tensor grid = at::zeros({body.vertices.cols(), 2});
  auto at = grid.accessor<float, 2>();
  std::vector<uint8_t> known(body.vertices.cols(), 0);
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    const int chart = body.face_part[f] - 1;
    for (int k = 0; k < 3; ++k) {
      const int v = body.faces(k, f);
      if (known[v]) continue;
      // Half a texel off the tile's edge: interpolation stays in the chart.
      const Eigen::Array2f in_tile = (body.face_uv.col(3 * f + k).array() * kTilePx).max(0.5f).min(kTilePx - 0.5f);
      at[v][0] = 2 * (static_cast<float>(chart % kColumns * kTilePx) + in_tile[0]) / (kColumns * kTilePx) - 1;
      at[v][1] = 2 * (static_cast<float>(chart / kColumns * kTilePx) + in_tile[1]) / (kRows * kTilePx) - 1;
      known[v] = 1;
    }
  }
  return grid;
}

Eigen::Matrix3Xf ToOffsets(const at::Tensor& offsets) {
  const at::Tensor plain = offsets.detach().contiguous();
  return Eigen::Map<const Eigen::Matrix3Xf>(plain.data_ptr<float>(), 3, plain.size(0));
}

}  // namespace

/// What all networks of a body share.
struct NetworkTraining::Surface {
  body::BodyTemplate body;
  body::TexelMap texels;
  OffsetAtlas atlas;
  at::Tensor laplacian, edge_from, edge_to, edge_length;  // (3 F) each once a face

  explicit Surface(const body::BodyTemplate& of) : body(of), texels(MapTexels(of, kTilePx)) {
    atlas = {kRows * kTilePx, kColumns * kTilePx, VertexGrid(of)};
    laplacian = LaplacianTensor(of);
    std::vector<int64_t> from, to;
    std::vector<float> length;
    for (Eigen::Index f = 0; f < of.faces.cols(); ++f) {
      for (int k = 0; k < 3; ++k) {
        const int a = of.faces(k, f), b = of.faces((k + 1) % 3, f);
        from.push_back(a), to.push_back(b);
        length.push_back(std::max(1e-4f, (of.vertices.col(a) - of.vertices.col(b)).norm()));
      }
    }
    edge_from = ToTensor(from), edge_to = ToTensor(to), edge_length = at::tensor(length).unsqueeze(1);
  }

  /// The posed surface about its root, without the root's turn: (1, 3, H, W) metres.
  at::Tensor Positions(const body::ArticulatedPose& pose) const {
    body::ArticulatedPose about_root = pose;
    about_root.shift.setZero(), about_root.local_rotations[0].setIdentity();
    Eigen::Matrix3Xf vertices = SkinVertices(body, ToBodyPose(body, about_root));
    vertices.colwise() -= body.bone_heads.col(0).cast<float>();
    at::Tensor map = at::zeros({1, 3, atlas.height, atlas.width});
    auto at = map.accessor<float, 4>();
    for (size_t texel = 0; texel < texels.face.size(); ++texel) {
      if (texels.face[texel] < 0) continue;
      const auto in_chart = static_cast<int>(texel % (kTilePx * kTilePx)),
                 chart = static_cast<int>(texel / (kTilePx * kTilePx));
      const Eigen::Vector3f x = AtTexel(body, texels, texel, vertices);
      for (int c = 0; c < 3; ++c)
        at[0][c][chart / kColumns * kTilePx + in_chart / kTilePx][chart % kColumns * kTilePx + in_chart % kTilePx] = x[c];
    }
    return map;
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

body::PoseOffsets NetworkTraining::Train(const std::vector<int>& indices) const {
  OffsetNet net(options_.net, surface_->atlas, options_.seed);
  Adam adam;
  for (auto& parameter : net->named_parameters()) adam.Add(parameter.key(), parameter.value());
  Rng rng(options_.seed);
  for (int i = 0; i < options_.steps; ++i) {
    const body::PosedStep& step = take_.steps[indices[rng.Index(static_cast<int64_t>(indices.size()))]];
    SilhouetteViews views{&take_, &step, {}, options_.soft};
    for (int k = 0; k < static_cast<int>(step.used.size()); ++k) {
      if (step.used[k]) views.views.push_back(k);
    }
    while (static_cast<int>(views.views.size()) > options_.views_per_step)
      views.views.erase(views.views.begin() + rng.Index(static_cast<int64_t>(views.views.size())));
    const at::Tensor offsets = net->forward(surface_->Positions(step.seen));
    const at::Tensor loss = options_.silhouette * SilhouetteOfOffsets(offsets, views) + surface_->Regularity(offsets, options_);
    adam.ClearGradients();
    loss.backward();
    const double fraction = static_cast<double>(i) / options_.steps;
    adam.Step(options_.learning_rate * (fraction < 0.5 ? 1 : 2 * (1 - fraction)));
  }
  return [net, surface = surface_](const body::ArticulatedPose& pose) {
    const torch::NoGradGuard no_gradients;
    OffsetNet copy = net;
    return ToOffsets(copy->forward(surface->Positions(pose)));
  };
}

std::optional<body::LinearOffsets> NetworkTraining::TrainLinear(const std::vector<int>& indices) const {
  std::vector<body::ArticulatedPose> poses;
  for (const int i : indices) poses.push_back(take_.steps[i].seen);
  return body::Linearised(Train(indices), poses);
}

body::OffsetTrainer NetworkTrainer(const NetworkTraining* training) {
  return {"network's offsets", [training](const std::vector<int>& indices) { return training->TrainLinear(indices); }};
}

}  // namespace mvstudio::avatar
