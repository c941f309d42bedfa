#include "synth/cloth/dressed_body.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "avatar/body/role_bones.h"
#include "core/check.h"
#include "core/error.h"
#include "core/random.h"
#include "core/units.h"

namespace mvstudio::synth {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kSlab = 0.025;  // m, half height of the slice of the body that a ring lies around

/// Vertices of trunk and thighs.
std::vector<int> TrunkVertices(const body::BodyTemplate& body) {
  using Role = body::BoneRole;
  const std::vector<Role> roles = body::InheritedRoles(body);
  std::vector<int> trunk;
  for (Eigen::Index i = 0; i < body.vertices.cols(); ++i) {
    float weight = 0;
    for (int k = 0; k < 4; ++k) {
      const Role role = roles[body.skin_bones(k, i)];
      const bool counts = role == Role::kPelvis || role == Role::kSpine || role == Role::kChest || role == Role::kLeftThigh ||
                          role == Role::kRightThigh;
      if (counts) weight += body.skin_weights(k, i);
    }
    if (weight > 0.75f) trunk.push_back(static_cast<int>(i));
  }
  return trunk;
}

/// Measures of a garment in body, metres.
struct Piece {
  std::string name;
  double top, bottom;  // heights
  double ease;         // distance from the body at the top
  double flare;
  int pinned_rows;
};

class Tailor {
 public:
  Tailor(const body::BodyTemplate& body, const Cut& cut) : cut_(cut), trunk_(TrunkVertices(body)) {
    MVS_CHECK(cut.columns >= 8 && cut.columns % 4 == 0 && cut.spacing_m > 0.001, "cut of " << cut.columns << " columns");
    out_.naked = body;
    out_.surface = body;
    out_.surface.shapes = {};
    out_.surface.pose_directions = {};
    out_.body_vertices = static_cast<int>(body.vertices.cols());
    out_.body_faces = static_cast<int>(body.faces.cols());
    const Vector3d hips = body.coco19.col(2);
    center_ = hips.head<2>();
    out_.scale = body.coco19(2, 0) / 1.43;
  }

  DressedBody Run() {
    Rng rng(cut_.seed * 0x2545f4914f6cdd1dull + 11);
    const double hips = out_.naked.coco19(2, 2), trunk = out_.naked.coco19(2, 0) - hips;
    const double knees = 0.5 * (out_.naked.coco19(2, 7) + out_.naked.coco19(2, 13));
    const auto vary = [&rng] { return 1 + 0.1 * rng.Uniform(-1, 1); };
    const double skirt_bottom = hips - 0.86 * vary() * (hips - knees), shirt_bottom = hips - 0.10 * vary() * trunk;
    Add({"skirt", hips + 0.14 * trunk, skirt_bottom, 0.004 * out_.scale, cut_.skirt_flare * vary(), 2}, &rng);
    Add({"shirt", hips + 0.44 * trunk, shirt_bottom, 0.004 * out_.scale, cut_.shirt_flare * vary(), 2}, &rng);
    out_.covered.resize(out_.surface.vertices.cols(), 0);
    for (const int i : trunk_) {
      const double z = out_.naked.vertices(2, i);
      out_.covered[i] = z < hips + 0.40 * trunk && z > skirt_bottom + 0.08 * out_.scale;
    }
    return std::move(out_);
  }

 private:
  /// Radius of the convex outline of the body at height z, a column each: r(phi) = min over theta of h(theta) / cos(theta -
  /// phi) of its support function h.
  Eigen::VectorXd Outline(double z) const {
    const int columns = cut_.columns;
    Eigen::VectorXd support = Eigen::VectorXd::Constant(columns, -1);
    for (const int i : trunk_) {
      if (std::abs(out_.naked.vertices(2, i) - z) > kSlab * out_.scale) continue;
      const Vector2d x = out_.naked.vertices.col(i).head<2>().cast<double>() - center_;
      for (int c = 0; c < columns; ++c) support[c] = std::max(support[c], x.dot(Direction(c)));
    }
    if (support.minCoeff() <= 0)
      throw UsageError("option 'subject': no garment fits this body: trunk and thighs are not around its hips at a height of " +
                       std::to_string(z) + " m");
    Eigen::VectorXd radius = Eigen::VectorXd::Constant(columns, 1e9);
    for (int c = 0; c < columns; ++c) {
      for (int d = 0; d < columns; ++d) {
        const double cosine = std::cos(2 * kPi * (c - d) / columns);
        if (cosine > 0.05) radius[c] = std::min(radius[c], support[d] / cosine);
      }
    }
    return radius;
  }

  Vector2d Direction(int column) const {
    const double phi = 2 * kPi * column / cut_.columns;
    return {std::cos(phi), std::sin(phi)};
  }

  /// A few waves around the body.
  Eigen::VectorXd Unevenness(Rng* rng) const {
    Eigen::VectorXd waves = Eigen::VectorXd::Zero(cut_.columns);
    for (int m = 5; m <= 16; ++m) {
      const double phase = rng->Uniform(0, 2 * kPi), size = cut_.unevenness * rng->Uniform();
      for (int c = 0; c < cut_.columns; ++c) waves[c] += size * std::cos(2 * kPi * m * c / cut_.columns + phase);
    }
    return waves;
  }

  void Add(const Piece& piece, Rng* rng) {
    Garment garment;
    garment.name = piece.name, garment.columns = cut_.columns, garment.pinned_rows = piece.pinned_rows;
    garment.first = static_cast<int>(out_.surface.vertices.cols());
    garment.rows = std::max(6, static_cast<int>(std::lround((piece.top - piece.bottom) / (cut_.spacing_m * out_.scale))) + 1);
    const Eigen::VectorXd waves = Unevenness(rng);
    Eigen::Matrix3Xf vertices(3, garment.vertices());
    Eigen::VectorXd widest = Eigen::VectorXd::Zero(cut_.columns);
    for (int r = 0; r < garment.rows; ++r) {
      const double share = static_cast<double>(r) / (garment.rows - 1), z = piece.top + share * (piece.bottom - piece.top);
      widest = widest.cwiseMax(Outline(z));
      for (int c = 0; c < cut_.columns; ++c) {
        double radius = widest[c] + piece.ease + piece.flare * (piece.top - z);
        if (r >= piece.pinned_rows) radius *= 1 + share * waves[c];
        radius = std::max(radius, Inner(z, c));
        const Vector2d at = center_ + radius * Direction(c);
        vertices.col(r * cut_.columns + c) = Vector3d(at.x(), at.y(), z).cast<float>();
      }
    }
    Append(garment, vertices);
    AppendFaces(garment);
    AppendWeights(garment);
    out_.garments.push_back(garment);
  }

  /// Least radius outside the garments that are there already.
  double Inner(double z, int column) const {
    double radius = 0;
    for (const Garment& g : out_.garments) {
      for (int r = 0; r < g.rows; ++r) {
        const Eigen::Vector3f x = out_.surface.vertices.col(g.At(r, column));
        if (std::abs(x.z() - z) < cut_.spacing_m * out_.scale)
          radius = std::max(radius, (x.head<2>().cast<double>() - center_).norm() + 0.008 * out_.scale);
      }
    }
    return radius;
  }

  void Append(const Garment& garment, const Eigen::Matrix3Xf& vertices) {
    body::BodyTemplate& s = out_.surface;
    s.vertices.conservativeResize(Eigen::NoChange, garment.first + garment.vertices());
    s.vertices.rightCols(garment.vertices()) = vertices;
  }

  /// Two triangles a cell, with the parts of DensePose that lie beneath: thighs for the skirt, the trunk for the shirt.
  void AppendFaces(const Garment& g) {
    body::BodyTemplate& s = out_.surface;
    Eigen::Index f = s.faces.cols();
    const Eigen::Index count = 2 * static_cast<Eigen::Index>(g.rows - 1) * g.columns;
    s.faces.conservativeResize(Eigen::NoChange, f + count);
    s.face_uv.conservativeResize(Eigen::NoChange, 3 * (f + count));
    s.face_part.resize(f + count);
    for (int r = 0; r + 1 < g.rows; ++r) {
      for (int c = 0; c < g.columns; ++c) {
        const std::array<std::array<int, 2>, 4> cell = {{{r, c}, {r + 1, c}, {r + 1, c + 1}, {r, c + 1}}};
        for (const auto& corners : {std::array<int, 3>{0, 1, 3}, std::array<int, 3>{1, 2, 3}}) {
          s.face_part[f] = Part(g, c);
          for (int k = 0; k < 3; ++k) {
            const auto [row, column] = cell[corners[k]];
            s.faces(k, f) = g.At(row, column);
            s.face_uv.col(3 * f + k) = Uv(g, row, column, c);
          }
          ++f;
        }
      }
    }
  }

  static int Part(const Garment& g, int column) {
    static constexpr int kSkirt[] = {8, 7, 9, 10};  // behind left, behind right, before right, before left
    return g.name == "skirt" ? kSkirt[4 * column / g.columns] : (2 * column / g.columns == 0 ? 1 : 2);
  }

  static Eigen::Vector2f Uv(const Garment& g, int row, int column, int cell_column) {
    const int charts = g.name == "skirt" ? 4 : 2, chart = charts * cell_column / g.columns;
    const double u = static_cast<double>(charts * column) / g.columns - chart, v = static_cast<double>(row) / (g.rows - 1);
    return g.name == "skirt" ? Eigen::Vector2d(u, v).cast<float>() : Eigen::Vector2d(u, 0.55 * (1 - v)).cast<float>();
  }

  int NearestTrunk(const Eigen::Vector3f& x) const {
    int nearest = trunk_.front();
    for (const int i : trunk_) {
      if ((out_.naked.vertices.col(i) - x).squaredNorm() < (out_.naked.vertices.col(nearest) - x).squaredNorm()) nearest = i;
    }
    return nearest;
  }

  /// Weights of the nearest vertices of the body, averaged over neighbours of the grid, and the largest four of them.
  void AppendWeights(const Garment& g) {
    const body::BodyTemplate& naked = out_.naked;
    Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(naked.bone_names.size()), g.vertices());
    for (int i = 0; i < g.vertices(); ++i) {
      const int from = NearestTrunk(out_.surface.vertices.col(g.first + i));
      for (int k = 0; k < 4; ++k) weights(naked.skin_bones(k, from), i) += naked.skin_weights(k, from);
    }
    for (int round = 0; round < 8; ++round) weights = Smoothed(g, weights);
    body::BodyTemplate& s = out_.surface;
    s.skin_bones.conservativeResize(Eigen::NoChange, g.first + g.vertices());
    s.skin_weights.conservativeResize(Eigen::NoChange, g.first + g.vertices());
    for (int i = 0; i < g.vertices(); ++i) {
      double sum = 0;
      std::array<double, 4> largest{};
      for (int k = 0; k < 4; ++k) {
        Eigen::Index bone = 0;
        sum += largest[k] = weights.col(i).maxCoeff(&bone);
        weights(bone, i) = 0;
        s.skin_bones(k, g.first + i) = static_cast<int>(bone);
      }
      for (int k = 0; k < 4; ++k) s.skin_weights(k, g.first + i) = static_cast<float>(largest[k] / sum);
    }
  }

  static Eigen::MatrixXd Smoothed(const Garment& g, const Eigen::MatrixXd& weights) {
    Eigen::MatrixXd out(weights.rows(), weights.cols());
    for (int r = 0; r < g.rows; ++r) {
      for (int c = 0; c < g.columns; ++c) {
        const int at = g.At(r, c) - g.first, up = g.At(std::max(0, r - 1), c) - g.first;
        const int down = g.At(std::min(g.rows - 1, r + 1), c) - g.first;
        out.col(at) = 0.2 * (weights.col(at) + weights.col(up) + weights.col(down) + weights.col(g.At(r, c - 1) - g.first) +
                             weights.col(g.At(r, c + 1) - g.first));
      }
    }
    return out;
  }

  const Cut cut_;
  const std::vector<int> trunk_;
  Vector2d center_;
  DressedBody out_;
};

}  // namespace

DressedBody Dress(const body::BodyTemplate& body, const Cut& cut) { return Tailor(body, cut).Run(); }

}  // namespace mvstudio::synth
