#include "avatar/body/texture/view_choice.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "avatar/body/texture/labelling.h"
#include "avatar/body/texture/level_seams.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3f;
using Colour = std::array<uint8_t, 3>;

constexpr int kMostDepthPx = 6;  // farther from the mask's edge nothing changes

/// Pixels to the nearest one outside the mask along rows, columns and diagonals, at most kMostDepthPx. (H, W)
std::vector<uint8_t> DepthInMask(const Image& mask) {
  std::vector<uint8_t> depth(mask.pixels.size());
  const int w = mask.width, h = mask.height;
  const auto at = [&](int x, int y) {
    return x < 0 || y < 0 || x >= w || y >= h ? 0 : int{depth[static_cast<size_t>(y) * w + x]};
  };
  const auto pass = [&](int x, int y, int by) {
    const int least = std::min({at(x - by, y), at(x, y - by), at(x - by, y - by), at(x + by, y - by)});
    uint8_t& here = depth[static_cast<size_t>(y) * w + x];
    here = static_cast<uint8_t>(std::min<int>(here, least + 1));
  };
  for (size_t i = 0; i < depth.size(); ++i) depth[i] = mask.pixels[i] >= 128 ? kMostDepthPx : 0;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) pass(x, y, 1);
  for (int y = h - 1; y >= 0; --y)
    for (int x = w - 1; x >= 0; --x) pass(x, y, -1);
  return depth;
}

/// What one view shows of the faces and of their vertices.
struct ViewFacts {
  std::vector<float> weight;   // (F) 0: the face is not seen wholly
  std::vector<Colour> colour;  // (V)
};

/// All corners and the middle are seen: the area of the image that the face covers, less near the mask's edge.
float WeightOf(const ViewSampler& sampler, const Image& mask, const std::vector<uint8_t>& depth, int face) {
  const std::optional<ViewSample> middle = sampler.At(face, Vector3f::Constant(1.0f / 3));
  if (!middle) return 0;
  for (int k = 0; k < 3; ++k) {
    if (!sampler.At(face, Vector3f::Unit(k))) return 0;
  }
  const auto x = static_cast<size_t>(std::lround(middle->px[0])), y = static_cast<size_t>(std::lround(middle->px[1]));
  return middle->weight * static_cast<float>(depth[y * static_cast<size_t>(mask.width) + x]) / kMostDepthPx;
}

ViewFacts LookAt(const BodyTemplate& body, const TextureView& view) {
  const ViewSampler sampler(body, view);
  const std::vector<uint8_t> depth = DepthInMask(view.mask);
  ViewFacts facts{std::vector<float>(body.face_part.size(), 0), std::vector<Colour>(body.vertices.cols(), Colour{})};
  for (size_t f = 0; f < facts.weight.size(); ++f) facts.weight[f] = WeightOf(sampler, view.mask, depth, static_cast<int>(f));
  for (size_t v = 0; v < facts.colour.size(); ++v) {
    const std::optional<Eigen::Vector2d> px = sampler.VertexPx(static_cast<int>(v));
    if (px) facts.colour[v] = BilinearColour(view.image, *px);
  }
  return facts;
}

/// Two seen faces with a common edge, by their numbers among the seen ones.
struct SharedEdge {
  int a = 0, b = 0, from = 0, to = 0;  // faces, vertices
  double length_mm = 0;
};

std::vector<SharedEdge> SharedEdges(const BodyTemplate& body, const std::vector<int>& node_of_face) {
  std::map<std::pair<int, int>, int> first;  // vertices -> node
  std::vector<SharedEdge> edges;
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    const int node = node_of_face[static_cast<size_t>(f)];
    for (int k = 0; k < 3 && node >= 0; ++k) {
      const auto [low, high] = std::minmax({body.faces(k, f), body.faces((k + 1) % 3, f)});
      const auto [found, is_new] = first.emplace(std::make_pair(low, high), node);
      if (is_new || found->second == node) continue;
      edges.push_back({found->second, node, low, high, 1e3 * (body.vertices.col(low) - body.vertices.col(high)).norm()});
    }
  }
  return edges;
}

int Difference(const Colour& a, const Colour& b) {
  return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]);
}

/// Costs are in hundredths of mm^2 of unseen surface.
constexpr double kUnit = 100;

struct SeenFaces {
  std::vector<int> face, best;    // (N) face of a node, the view that shows it best
  std::vector<int> node_of_face;  // (F)
};

SeenFaces FindSeen(const std::vector<ViewFacts>& facts, size_t num_faces) {
  SeenFaces seen;
  seen.node_of_face.assign(num_faces, -1);
  for (size_t f = 0; f < num_faces; ++f) {
    int best = -1;
    for (size_t l = 0; l < facts.size(); ++l) {
      if (facts[l].weight[f] > (best < 0 ? 0 : facts[static_cast<size_t>(best)].weight[f])) best = static_cast<int>(l);
    }
    if (best < 0) continue;
    seen.node_of_face[f] = static_cast<int>(seen.face.size());
    seen.face.push_back(static_cast<int>(f)), seen.best.push_back(best);
  }
  return seen;
}

/// (N, L) row by row.
std::vector<int64_t> DataCosts(const BodyTemplate& body, const std::vector<ViewFacts>& facts, const SeenFaces& seen) {
  std::vector<int64_t> costs;
  for (size_t n = 0; n < seen.face.size(); ++n) {
    const auto f = static_cast<size_t>(seen.face[n]);
    const Vector3f a = body.vertices.col(body.faces(0, f)), b = body.vertices.col(body.faces(1, f)),
                   c = body.vertices.col(body.faces(2, f));
    const double area_mm2 = 0.5e6 * (b - a).cross(c - a).norm(), best = facts[static_cast<size_t>(seen.best[n])].weight[f];
    for (const ViewFacts& view : facts) {
      const double lost = 1 - view.weight[f] / best;
      costs.push_back(view.weight[f] > 0 ? std::llround(kUnit * area_mm2 * lost) : kForbiddenLabel);
    }
  }
  return costs;
}

Vector3f AsVector(const Colour& colour) { return Vector3f(colour[0], colour[1], colour[2]); }

/// Colours of the vertices in a view, NaN where they lie outside it. (3, V)
Eigen::Matrix3Xf VertexColours(const BodyTemplate& body, const ViewSampler& sampler, const Image& image) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  Eigen::Matrix3Xf colours = Eigen::Matrix3Xf::Constant(3, body.vertices.cols(), none);
  for (int v = 0; v < colours.cols(); ++v) {
    const std::optional<Eigen::Vector2d> px = sampler.VertexPx(v);
    if (px) colours.col(v) = AsVector(BilinearColour(image, *px));
  }
  return colours;
}

}  // namespace

ViewChoice ChooseViews(const BodyTemplate& body, const std::vector<TextureView>& views, const ViewChoiceOptions& options,
                       const RunContext& run) {
  constexpr int kSeamLevels = 6;  // a seam costs as if the views differed by so many levels more, all channels together
  MVS_CHECK(options.seam_price >= 0 && options.seam_price < 1e3, "price of seams " << options.seam_price);
  std::vector<ViewFacts> facts(views.size());
  ParallelFor(static_cast<int64_t>(views.size()), run.num_threads, [&](int64_t l) { facts[l] = LookAt(body, views[l]); });
  const SeenFaces seen = FindSeen(facts, body.face_part.size());
  const std::vector<int64_t> data = DataCosts(body, facts, seen);
  const std::vector<SharedEdge> edges = SharedEdges(body, seen.node_of_face);
  LabelProblem problem;
  problem.num_nodes = static_cast<int>(seen.face.size()), problem.num_labels = static_cast<int>(views.size());
  std::vector<int64_t> price;  // whole numbers keep the metric exact
  for (const SharedEdge& edge : edges) {
    problem.edges.push_back({edge.a, edge.b});
    price.push_back(std::llround(kUnit * options.seam_price * edge.length_mm / 2));
  }
  problem.data = [&](int node, int label) {
    return data[static_cast<size_t>(node) * views.size() + static_cast<size_t>(label)];
  };
  problem.pair = [&](size_t e, int a, int b) -> int64_t {
    if (a == b) return 0;
    const std::vector<Colour>&one = facts[static_cast<size_t>(a)].colour, &other = facts[static_cast<size_t>(b)].colour;
    const auto from = static_cast<size_t>(edges[e].from), to = static_cast<size_t>(edges[e].to);
    return price[e] * (Difference(one[from], other[from]) + Difference(one[to], other[to]) + 2 * kSeamLevels);
  };
  ViewChoice choice;
  choice.energy_of_best = EnergyOf(problem, seen.best);
  const std::vector<int> labels = ExpandLabels(problem, seen.best, options.max_sweeps);
  choice.energy = EnergyOf(problem, labels);
  choice.num_views = static_cast<int>(std::set<int>(labels.begin(), labels.end()).size());
  choice.view_of_face.assign(body.face_part.size(), -1);
  for (size_t n = 0; n < labels.size(); ++n) choice.view_of_face[static_cast<size_t>(seen.face[n])] = labels[n];
  for (const SharedEdge& edge : edges)
    choice.seam_m += labels[static_cast<size_t>(edge.a)] != labels[static_cast<size_t>(edge.b)] ? 1e-3 * edge.length_mm : 0;
  return choice;
}

Textures BakeChosenViews(const BodyTemplate& body, const std::vector<TextureView>& views, const ViewChoice& choice, int size_px,
                         bool level_seams, const RunContext& run) {
  MVS_CHECK(size_px >= 2, "charts of " << size_px << " px");
  const TexelMap map = MapTexels(body, size_px);
  const size_t chart = static_cast<size_t>(size_px) * size_px;
  std::vector<uint8_t> known(map.face.size(), 0);
  std::vector<Colour> colours(map.face.size());
  std::vector<Eigen::Matrix3Xf> at_vertices;  // (L)
  for (size_t l = 0; l < views.size(); ++l) {
    const ViewSampler sampler(body, views[l]);
    at_vertices.push_back(VertexColours(body, sampler, views[l].image));
    ParallelFor(static_cast<int64_t>(known.size()), run.num_threads, [&](int64_t t) {
      if (map.face[t] < 0 || choice.view_of_face[static_cast<size_t>(map.face[t])] != static_cast<int>(l)) return;
      const std::optional<ViewSample> sample = sampler.At(map.face[t], map.barycentric[t]);
      if (sample) known[t] = 1, colours[t] = sample->colour;
    });
  }
  SeamCorrections seams;
  if (level_seams) {
    seams = LevelSeams(body, choice.view_of_face,
                       [&](int vertex, int view) -> Vector3f { return at_vertices[static_cast<size_t>(view)].col(vertex); });
  }
  Textures out;
  out.fill(Image(size_px, size_px, 3, 128));
  for (size_t t = 0; t < known.size(); ++t) {
    if (!known[t]) continue;
    Vector3f colour = AsVector(colours[t]);
    if (level_seams) colour += seams.At(map.face[t], map.barycentric[t]);
    for (int c = 0; c < 3; ++c)
      out[t / chart].pixels[3 * (t % chart) + c] = static_cast<uint8_t>(std::lround(std::clamp(colour[c], 0.0f, 255.0f)));
  }
  FillTexels(std::move(known), &out);
  return out;
}

}  // namespace mvstudio::body
