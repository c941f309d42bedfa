#include "synth/cloth/cloth_sim.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "avatar/body/surface_nets.h"
#include "core/check.h"
#include "synth/cloth/nearest_vertex.h"

namespace mvstudio::synth {
namespace {

using Eigen::Vector3d;

constexpr double kGravity = 9.81;  // m/s^2
constexpr double kReach = 0.045;   // m from the skin where cloth can meet it during one call
constexpr double kBeside = 0.016;  // m along the skin, where its vertices lie closer than that
constexpr int kNormalRounds = 4;   // of smoothing
constexpr double kMaxSpeed = 30;   // m/s
constexpr int kIterations = 2;     // of the constraints in each step

/// Vertex normals (3, V), averaged over neighbours: folds and pits of a fitted surface have wild ones.
Eigen::Matrix3Xd ContactNormals(const Eigen::Matrix3Xd& skin, const Eigen::Matrix3Xi& faces) {
  Eigen::Matrix3Xd normals = body::VertexNormals(skin.cast<float>(), faces).cast<double>();
  for (int round = 0; round < kNormalRounds; ++round) {
    Eigen::Matrix3Xd sum = Eigen::Matrix3Xd::Zero(3, normals.cols());
    for (Eigen::Index f = 0; f < faces.cols(); ++f) {
      const Vector3d mean = normals.col(faces(0, f)) + normals.col(faces(1, f)) + normals.col(faces(2, f));
      for (int k = 0; k < 3; ++k) sum.col(faces(k, f)) += mean;
    }
    normals = sum.colwise().normalized();
  }
  return normals;
}

ClothMaterial Scaled(ClothMaterial material, double scale) {
  material.clearance_m *= scale, material.layers_m *= scale;
  return material;
}

}  // namespace

ClothSim::ClothSim(const DressedBody& dressed, const ClothMaterial& material)
    : dressed_(dressed),
      material_(Scaled(material, dressed.scale)),
      net_(MakeClothNet(dressed, material_)),
      edge_force_(net_.edges.size()),
      bend_force_(net_.bends.size()),
      contacts_(net_.mass_kg.size()) {}

Status ClothSim::Reset(const Eigen::Matrix3Xf& skinned) {
  MVS_CHECK(skinned.cols() == dressed_.surface.vertices.cols(), skinned.cols() << " vertices");
  if (!skinned.allFinite()) return Status::kNonFiniteInput;
  skin_ = skinned.cast<double>();
  x_ = skin_.rightCols(static_cast<Eigen::Index>(net_.mass_kg.size()));
  velocity_ = Eigen::Matrix3Xd::Zero(3, x_.cols());
  normals_ = ContactNormals(skin_.leftCols(dressed_.body_vertices), dressed_.naked.faces);
  return Status::kOk;
}

Status ClothSim::Advance(const Eigen::Matrix3Xf& skinned, int steps, double step_s) {
  MVS_CHECK(skinned.cols() == skin_.cols() && steps > 0 && step_s > 0, skinned.cols() << " vertices, " << steps << " steps");
  if (!skinned.allFinite()) return Status::kNonFiniteInput;
  const Eigen::Matrix3Xd to = skinned.cast<double>();
  FindContacts(to);
  for (int s = 0; s < steps; ++s) SubStep(to, static_cast<double>(s) / steps, static_cast<double>(s + 1) / steps, step_s);
  skin_ = to;
  return Sound() ? Status::kOk : Status::kNotConverged;
}

/// The nearest vertex of the skin at the beginning; the contact plane moves with it.
void ClothSim::FindContacts(const Eigen::Matrix3Xd& to) {
  const Eigen::Matrix3Xd normals = ContactNormals(to.leftCols(dressed_.body_vertices), dressed_.naked.faces);
  const NearestVertex nearest(skin_.leftCols(dressed_.body_vertices), kReach * dressed_.scale);
  const double beside = kBeside * dressed_.scale;
  for (size_t i = 0; i < contacts_.size(); ++i) {
    const auto col = static_cast<Eigen::Index>(i);
    int v = net_.inverse_mass_kg[i] > 0 ? nearest.Find(x_.col(col)) : -1;
    if (v >= 0) {  // what lies beside a vertex more than below its plane is not inside
      const Vector3d off = x_.col(col) - skin_.col(v);
      const double height = off.dot(normals_.col(v));
      if (height < material_.clearance_m && off.squaredNorm() - height * height > beside * beside) v = -1;
    }
    contacts_[i].vertex = v;
    if (v < 0) continue;
    contacts_[i].from = skin_.col(v), contacts_[i].to = to.col(v);
    contacts_[i].normal_from = normals_.col(v), contacts_[i].normal_to = normals.col(v);
  }
  normals_ = normals;
}

void ClothSim::SubStep(const Eigen::Matrix3Xd& to, double before, double after, double step_s) {
  const Eigen::Index count = x_.cols(), first = dressed_.body_vertices;
  const double keep = std::exp(-material_.drag_hz * step_s);
  before_ = x_;
  for (Eigen::Index i = 0; i < count; ++i) {
    if (net_.inverse_mass_kg[i] == 0) {
      x_.col(i) = skin_.col(first + i) + after * (to.col(first + i) - skin_.col(first + i));
      continue;
    }
    velocity_.col(i) *= keep;
    velocity_(2, i) -= kGravity * step_s;
    x_.col(i) += step_s * velocity_.col(i);
  }
  std::fill(edge_force_.begin(), edge_force_.end(), 0);
  std::fill(bend_force_.begin(), bend_force_.end(), 0);
  for (int i = 0; i < kIterations; ++i) {
    SolveBends(step_s, i % 2 == 1);
    SolveEdges(step_s, i % 2 == 1);
    SolveLayers();
    SolveContacts(before, after);
  }
  velocity_ = (x_ - before_) / step_s;
}

/// Equation 18 of Macklin et al. 2016; sweeps run both ways so that none is preferred.
void ClothSim::SolveEdges(double step_s, bool backwards) {
  const size_t count = net_.edges.size();
  for (size_t k = 0; k < count; ++k) {
    const size_t e = backwards ? count - 1 - k : k;
    const ClothEdge& edge = net_.edges[e];
    const double wa = net_.inverse_mass_kg[edge.a], wb = net_.inverse_mass_kg[edge.b];
    const Vector3d way = x_.col(edge.a) - x_.col(edge.b);
    const double length = way.norm(), softness = edge.compliance_m_n / (step_s * step_s);
    if (!(length > 1e-9)) continue;
    const double force = (edge.rest_m - length - softness * edge_force_[e]) / (wa + wb + softness);
    edge_force_[e] += force;
    x_.col(edge.a) += wa * force / length * way;
    x_.col(edge.b) -= wb * force / length * way;
  }
}

void ClothSim::SolveBends(double step_s, bool backwards) {
  const size_t count = net_.bends.size();
  for (size_t k = 0; k < count; ++k) {
    const size_t e = backwards ? count - 1 - k : k;
    const ClothBend& bend = net_.bends[e];
    const double wa = net_.inverse_mass_kg[bend.a], wb = net_.inverse_mass_kg[bend.b], wc = net_.inverse_mass_kg[bend.c];
    const Vector3d way = (2 * x_.col(bend.b) - x_.col(bend.a) - x_.col(bend.c)) / 3;
    const double length = way.norm(), softness = bend.compliance_m_n / (step_s * step_s);
    if (!(length > 1e-9)) continue;
    const double force = (bend.rest_m - length - softness * bend_force_[e]) / ((wa + 4 * wb + wc) / 9 + softness);
    bend_force_[e] += force;
    const Vector3d move = force / (3 * length) * way;
    x_.col(bend.a) -= wa * move;
    x_.col(bend.b) += 2 * wb * move;
    x_.col(bend.c) -= wc * move;
  }
}

void ClothSim::SolveLayers() {
  for (const ClothLayer& layer : net_.layers) {
    const Vector3d around = x_.col(layer.right) - x_.col(layer.left), down = x_.col(layer.down) - x_.col(layer.up);
    const Vector3d normal = down.cross(around).normalized();
    const double gap = normal.dot(x_.col(layer.outer) - x_.col(layer.inner)) - material_.layers_m;
    const double outer = net_.inverse_mass_kg[layer.outer], inner = net_.inverse_mass_kg[layer.inner];
    if (gap >= 0 || !(outer + inner > 0)) continue;
    x_.col(layer.outer) -= outer / (outer + inner) * gap * normal;
    x_.col(layer.inner) += inner / (outer + inner) * gap * normal;
  }
}

/// Out of the skin, with Coulomb's friction against it.
void ClothSim::SolveContacts(double before, double after) {
  for (size_t i = 0; i < contacts_.size(); ++i) {
    const Contact& contact = contacts_[i];
    if (contact.vertex < 0) continue;
    const auto col = static_cast<Eigen::Index>(i);
    const Vector3d normal = (contact.normal_from + after * (contact.normal_to - contact.normal_from)).normalized();
    const Vector3d point = contact.from + after * (contact.to - contact.from);
    const double depth = material_.clearance_m - normal.dot(x_.col(col) - point);
    if (!(depth > 0)) continue;
    x_.col(col) += depth * normal;
    Vector3d slip = x_.col(col) - before_.col(col) - (after - before) * (contact.to - contact.from);
    slip -= normal.dot(slip) * normal;
    const double length = slip.norm();
    if (length > 0) x_.col(col) -= std::min(1.0, material_.friction * depth / length) * slip;
  }
}

bool ClothSim::Sound() const {
  if (!x_.allFinite() || !(max_speed() < kMaxSpeed)) return false;
  for (size_t e = 0; e < net_.structural; ++e) {
    const ClothEdge& edge = net_.edges[e];
    const double ratio = (x_.col(edge.a) - x_.col(edge.b)).norm() / edge.rest_m;
    if (!(ratio < 2 && ratio > 0.1)) return false;
  }
  return true;
}

double ClothSim::max_speed() const { return std::sqrt(velocity_.colwise().squaredNorm().maxCoeff()); }

ClothSim::Stretch ClothSim::stretch() const {
  Stretch stretch;
  for (size_t e = 0; e < net_.structural; ++e) {
    const ClothEdge& edge = net_.edges[e];
    const double strain = std::abs((x_.col(edge.a) - x_.col(edge.b)).norm() / edge.rest_m - 1);
    stretch.rms += strain * strain / static_cast<double>(net_.structural);
    stretch.max = std::max(stretch.max, strain);
  }
  stretch.rms = std::sqrt(stretch.rms);
  return stretch;
}

ClothSim::Energy ClothSim::energy() const {
  Energy energy;
  for (Eigen::Index i = 0; i < x_.cols(); ++i) {
    if (net_.inverse_mass_kg[i] == 0) continue;
    energy.kinetic_j += 0.5 * net_.mass_kg[i] * velocity_.col(i).squaredNorm();
    energy.gravity_j += kGravity * net_.mass_kg[i] * x_(2, i);
  }
  for (const ClothEdge& edge : net_.edges) {
    const double strain_m = (x_.col(edge.a) - x_.col(edge.b)).norm() - edge.rest_m;
    energy.elastic_j += 0.5 * strain_m * strain_m / edge.compliance_m_n;
  }
  for (const ClothBend& bend : net_.bends) {
    const double fold_m = ((2 * x_.col(bend.b) - x_.col(bend.a) - x_.col(bend.c)) / 3).norm() - bend.rest_m;
    energy.elastic_j += 0.5 * fold_m * fold_m / bend.compliance_m_n;
  }
  return energy;
}

}  // namespace mvstudio::synth
