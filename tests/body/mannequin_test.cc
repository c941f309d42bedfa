#include <map>
#include <set>

#include "avatar/body/body_template.h"
#include "avatar/body/role_bones.h"
#include "core/error.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

const BodyTemplate& Mannequin() {
  static const BodyTemplate body = MakeMannequin();
  return body;
}

TEST(Mannequin, HasTheRightSizeAndStandsOnTheFloor) {
  const BodyTemplate& body = Mannequin();
  const Eigen::Vector3f low = body.vertices.rowwise().minCoeff(), high = body.vertices.rowwise().maxCoeff();
  EXPECT_NEAR(high[2], 1.75, 0.02);
  EXPECT_NEAR(low[2], 0.0, 0.01);
  EXPECT_NEAR(low[0], -high[0], 0.01);
  EXPECT_GT(high[0] - low[0], 2 * (high[1] - low[1]));
  EXPECT_GT(body.faces.cols(), 8000);
  EXPECT_LT(body.faces.cols(), 30000);
  const BodyTemplate child = MakeMannequin(1.2, 0.5);
  EXPECT_NEAR(child.vertices.row(2).maxCoeff(), 1.2, 0.02);
  EXPECT_LT(child.faces.cols(), body.faces.cols() / 3);
  EXPECT_NEAR(child.coco19(2, 0) / body.coco19(2, 0), 1.2 / 1.75, 1e-9);
}

TEST(Mannequin, MeshIsClosedAndOfOnePiece) {
  const BodyTemplate& body = Mannequin();
  std::map<std::pair<int, int>, int> edges;
  std::vector<int> root(body.vertices.cols());
  for (size_t i = 0; i < root.size(); ++i) root[i] = static_cast<int>(i);
  auto find = [&](int i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (int f = 0; f < body.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int a = body.faces(k, f), b = body.faces((k + 1) % 3, f);
      ++edges[{a, b}];
      root[find(a)] = find(b);
    }
  }
  int bad = 0;
  for (const auto& [edge, count] : edges) {
    const bool open = count != 1 || edges.count({edge.second, edge.first}) != 1;
    bad += open;
    EXPECT_FALSE(open) << body.vertices.col(edge.first).transpose();
  }
  EXPECT_EQ(bad, 0);
  std::set<int> pieces;
  for (size_t i = 0; i < root.size(); ++i) pieces.insert(find(static_cast<int>(i)));
  EXPECT_EQ(pieces.size(), 1u);
}

TEST(Mannequin, SkinWeightsSumToOneAndFollowTheJoints) {
  const BodyTemplate& body = Mannequin();
  for (int i = 0; i < body.vertices.cols(); ++i) {
    EXPECT_NEAR(body.skin_weights.col(i).sum(), 1, 1e-5);
    EXPECT_GE(body.skin_weights.col(i).minCoeff(), 0);
    EXPECT_GE(body.skin_bones.col(i).minCoeff(), 0);
    EXPECT_LT(body.skin_bones.col(i).maxCoeff(), static_cast<int>(body.bone_names.size()));
  }
  for (size_t b = 0; b < body.bone_parents.size(); ++b) EXPECT_LT(body.bone_parents[b], static_cast<int>(b));
}

TEST(Mannequin, RolesAreThoseOfTheNames) {
  const BodyTemplate& body = Mannequin();
  const RoleBones bones = FindRoleBones(body);
  const auto name = [&](int bone) { return body.bone_names[bone]; };
  EXPECT_EQ(name(bones.pelvis), "pelvis");
  EXPECT_EQ(name(bones.head), "head");
  EXPECT_EQ(bones.spine.size(), 2u);
  EXPECT_EQ(name(bones.spine.back()), "chest");
  EXPECT_EQ(name(bones.neck.back()), "neck");
  for (int side = 0; side < 2; ++side) {
    const std::string prefix = side == 0 ? "l_" : "r_";
    const char* const arm[] = {"clavicle", "upper_arm", "forearm", "hand"};
    const char* const leg[] = {"thigh", "shin", "foot"};
    for (int i = 0; i < 4; ++i) EXPECT_EQ(name(bones.arms[side][i]), prefix + arm[i]);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(name(bones.legs[side][i]), prefix + leg[i]);
  }
}

TEST(Mannequin, IncompleteRolesAreRefused) {
  for (const auto& [bone, role] : {std::pair(0, BoneRole::kOther), {3, BoneRole::kHead}, {5, BoneRole::kOther}}) {
    BodyTemplate body = Mannequin();
    body.bone_roles[bone] = role;
    EXPECT_THROW(FindRoleBones(body), ContractViolation);
  }
}

TEST(Mannequin, HasOneShapeOnly) {
  EXPECT_EQ(WithShape(Mannequin(), Eigen::VectorXd()).vertices, Mannequin().vertices);
  EXPECT_THROW(WithShape(Mannequin(), Eigen::VectorXd::Ones(1)), ContractViolation);
}

/// A left limb's vertex never follows a right limb's bone.
TEST(Mannequin, SidesDoNotPullEachOther) {
  const BodyTemplate& body = Mannequin();
  for (int i = 0; i < body.vertices.cols(); ++i) {
    if (std::abs(body.vertices(0, i)) < 0.06) continue;
    const std::string other = body.vertices(0, i) > 0 ? "r_" : "l_";
    float weight = 0;
    for (int k = 0; k < 4; ++k) {
      if (body.bone_names[body.skin_bones(k, i)].rfind(other, 0) == 0) weight += body.skin_weights(k, i);
    }
    EXPECT_LT(weight, 0.02f) << body.vertices.col(i).transpose();
  }
}

TEST(Mannequin, AllChartsAreUsedOnTheRightSideOfTheBody) {
  const BodyTemplate& body = Mannequin();
  std::array<Eigen::Vector3d, kNumParts + 1> sum;
  std::array<int, kNumParts + 1> count{};
  sum.fill(Eigen::Vector3d::Zero());
  for (int f = 0; f < body.faces.cols(); ++f) {
    ASSERT_GE(body.face_part[f], 1);
    ASSERT_LE(body.face_part[f], kNumParts);
    for (int k = 0; k < 3; ++k) sum[body.face_part[f]] += body.vertices.col(body.faces(k, f)).cast<double>() / 3;
    ++count[body.face_part[f]];
  }
  for (int part = 1; part <= kNumParts; ++part) EXPECT_GT(count[part], 40) << "part " << part;
  auto mean = [&](int part) { return Eigen::Vector3d(sum[part] / count[part]); };
  for (auto [back, front] : {std::pair(1, 2), {7, 9}, {8, 10}, {11, 13}, {12, 14}})
    EXPECT_GT(mean(back)[1], mean(front)[1] + 0.03);
  for (int left : {4, 5, 8, 10, 12, 14, 15, 17, 19, 21, 24}) EXPECT_GT(mean(left)[0], 0.02) << left;
  for (int right : {3, 6, 7, 9, 11, 13, 16, 18, 20, 22, 23}) EXPECT_LT(mean(right)[0], -0.02) << right;
  for (auto [in, out] : {std::pair(15, 17), {16, 18}, {19, 21}, {20, 22}}) EXPECT_LT(mean(in)[2], mean(out)[2]);
}

/// Samples of a chart that more than one face claims, as a fraction of all covered samples.
TEST(Mannequin, ChartsDoNotOverlapThemselves) {
  const BodyTemplate& body = Mannequin();
  constexpr int kSize = 256;
  std::vector<int> hits(static_cast<size_t>(kNumParts + 1) * kSize * kSize, 0);
  for (int f = 0; f < body.faces.cols(); ++f) {
    const Eigen::Matrix<double, 2, 3> uv = body.face_uv.middleCols<3>(3 * f).cast<double>() * kSize;
    ASSERT_GE(uv.minCoeff(), 0);
    ASSERT_LE(uv.maxCoeff(), kSize);
    const Eigen::Vector2d a = uv.col(0), b = uv.col(1) - a, c = uv.col(2) - a;
    const double area = b[0] * c[1] - b[1] * c[0];
    for (int y = static_cast<int>(uv.row(1).minCoeff()); y <= uv.row(1).maxCoeff() && y < kSize; ++y) {
      for (int x = static_cast<int>(uv.row(0).minCoeff()); x <= uv.row(0).maxCoeff() && x < kSize; ++x) {
        const Eigen::Vector2d p = Eigen::Vector2d(x + 0.5, y + 0.5) - a;
        const double w1 = (p[0] * c[1] - p[1] * c[0]) / area, w2 = (b[0] * p[1] - b[1] * p[0]) / area;
        if (w1 > 0 && w2 > 0 && w1 + w2 < 1) ++hits[(static_cast<size_t>(body.face_part[f]) * kSize + y) * kSize + x];
      }
    }
  }
  for (int part = 1; part <= kNumParts; ++part) {
    int covered = 0, twice = 0;
    for (int i = 0; i < kSize * kSize; ++i) {
      const int n = hits[static_cast<size_t>(part) * kSize * kSize + i];
      covered += n > 0;
      twice += n > 1;
    }
    EXPECT_GT(covered, kSize * kSize / 2) << "part " << part;
    EXPECT_LT(twice, 0.02 * covered) << "part " << part;
  }
}

TEST(Mannequin, TexturesAreDistinctAndSeeded) {
  const auto a = MannequinTextures(64, 1), b = MannequinTextures(64, 1), c = MannequinTextures(64, 2);
  for (int k = 0; k < kNumParts; ++k) {
    EXPECT_EQ(a[k].pixels, b[k].pixels);
    EXPECT_NE(a[k].pixels, c[k].pixels);
  }
}

TEST(Mannequin, NonsenseSizesAreRefused) {
  EXPECT_THROW(MakeMannequin(-1), ContractViolation);
  EXPECT_THROW(MakeMannequin(1.75, 0), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::body
