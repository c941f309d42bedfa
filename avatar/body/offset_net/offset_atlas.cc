#include "avatar/body/offset_net/offset_atlas.h"

#include <algorithm>
#include <set>

#include "avatar/body/texture/texel_map.h"
#include "core/check.h"

namespace mvstudio::body {
namespace {

constexpr int kTile = OffsetAtlas::kTilePx;

Eigen::Vector2i TileCorner(int chart) { return {chart % OffsetAtlas::kColumns * kTile, chart / OffsetAtlas::kColumns * kTile}; }

void PlaceTexels(const BodyTemplate& body, OffsetAtlas* atlas) {
  const TexelMap map = MapTexels(body, kTile);
  std::vector<size_t> shown;
  for (size_t texel = 0; texel < map.face.size(); ++texel) {
    if (map.face[texel] >= 0) shown.push_back(texel);
  }
  atlas->corners.resize(3, static_cast<Eigen::Index>(shown.size()));
  atlas->shares.resize(3, atlas->corners.cols());
  for (size_t i = 0; i < shown.size(); ++i) {
    const auto in_chart = static_cast<int>(shown[i] % (kTile * kTile));
    const Eigen::Vector2i at =
        TileCorner(static_cast<int>(shown[i] / (kTile * kTile))) + Eigen::Vector2i(in_chart % kTile, in_chart / kTile);
    atlas->texels.push_back(at[1] * OffsetAtlas::kWidth + at[0]);
    atlas->corners.col(static_cast<Eigen::Index>(i)) = body.faces.col(map.face[shown[i]]);
    atlas->shares.col(static_cast<Eigen::Index>(i)) = map.barycentric[shown[i]];
  }
}

void PlaceVertices(const BodyTemplate& body, OffsetAtlas* atlas) {
  atlas->vertex_px = Eigen::Matrix2Xf::Constant(2, body.vertices.cols(), 0.5f);
  std::vector<uint8_t> known(static_cast<size_t>(body.vertices.cols()), 0);
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    const Eigen::Vector2f corner = TileCorner(body.face_part[static_cast<size_t>(f)] - 1).cast<float>();
    for (int k = 0; k < 3; ++k) {
      const int v = body.faces(k, f);
      if (known[static_cast<size_t>(v)]) continue;
      const Eigen::Array2f in_tile = (body.face_uv.col(3 * f + k).array() * kTile).max(0.5f).min(kTile - 0.5f);
      atlas->vertex_px.col(v) = corner.array() + in_tile - 0.5f;  // pixel centres have whole coordinates
      known[static_cast<size_t>(v)] = 1;
    }
  }
}

}  // namespace

OffsetAtlas MakeOffsetAtlas(const BodyTemplate& body) {
  MVS_CHECK(body.face_uv.cols() == 3 * body.faces.cols() && body.bone_heads.cols() > 0, "a body without charts or bones");
  OffsetAtlas atlas;
  PlaceTexels(body, &atlas);
  PlaceVertices(body, &atlas);
  atlas.coordinates.resize(5, body.vertices.cols());
  const Eigen::Array2f half(OffsetAtlas::kWidth / 2.0f, OffsetAtlas::kHeight / 2.0f);
  for (Eigen::Index v = 0; v < body.vertices.cols(); ++v) {
    atlas.coordinates.col(v).head<2>() = (atlas.vertex_px.col(v).array() + 0.5f) / half - 1;
    atlas.coordinates.col(v).tail<3>() = body.vertices.col(v) - body.bone_heads.col(0).cast<float>();
  }
  return atlas;
}

Eigen::Matrix3Xf PositionMap(const OffsetAtlas& atlas, const Eigen::Matrix3Xf& vertices) {
  Eigen::Matrix3Xf map = Eigen::Matrix3Xf::Zero(3, OffsetAtlas::kWidth * OffsetAtlas::kHeight);
  for (size_t i = 0; i < atlas.texels.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    for (int k = 0; k < 3; ++k) map.col(atlas.texels[i]) += atlas.shares(k, column) * vertices.col(atlas.corners(k, column));
  }
  return map;
}

OffsetSmoother::OffsetSmoother(const BodyTemplate& body, double stiffness) {
  std::set<std::pair<int, int>> edges;
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) edges.insert(std::minmax(body.faces(k, f), body.faces((k + 1) % 3, f)));
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index v = 0; v < body.vertices.cols(); ++v) entries.emplace_back(v, v, 1);
  for (const auto& [a, b] : edges) {
    if (a == b) continue;
    entries.emplace_back(a, a, stiffness), entries.emplace_back(b, b, stiffness);
    entries.emplace_back(a, b, -stiffness), entries.emplace_back(b, a, -stiffness);
  }
  Eigen::SparseMatrix<double> matrix(body.vertices.cols(), body.vertices.cols());
  matrix.setFromTriplets(entries.begin(), entries.end());
  solver_.compute(matrix);
  MVS_CHECK(solver_.info() == Eigen::Success, "stiffness " << stiffness);
}

Eigen::Matrix3Xf OffsetSmoother::Apply(const Eigen::Matrix3Xf& raw) const {
  const Eigen::MatrixXd columns = raw.transpose().cast<double>();
  return solver_.solve(columns).transpose().cast<float>();
}

}  // namespace mvstudio::body
