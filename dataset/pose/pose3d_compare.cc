#include "dataset/pose/pose3d_compare.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>

#include "core/some_of.h"
#include "core/statistics.h"
#include "dataset/pose/marker_labels.h"
#include "geometry/rig/alignment.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace {

using JointsByName = std::map<std::string, JointRow>;
struct Pair {
  const JointRow* joint;
  const JointRow* reference;
};

// Quantiles of chi-squared with 3 degrees of freedom.
constexpr double kChiSquared68 = 3.5058820;
constexpr double kChiSquared95 = 7.8147279;

/// A person and one of the reference in the same frame.
struct PersonPair {
  int person = 0, reference = 0;
  double mean_m = 0;  // distance of their joints
  std::vector<Pair> joints;
};

PersonPair PairJoints(int person, const JointsByName& joints, int reference, const JointsByName& reference_joints) {
  PersonPair pair{person, reference, 0, {}};
  for (const auto& [name, joint] : joints) {
    const auto it = reference_joints.find(name);
    if (it == reference_joints.end()) continue;
    pair.joints.push_back({&joint, &it->second});
    pair.mean_m += (joint.x_in_world - it->second.x_in_world).norm();
  }
  pair.mean_m /= static_cast<double>(std::max<size_t>(1, pair.joints.size()));
  return pair;
}

/// Pairs of one frame, nearest first, each person once.
std::vector<PersonPair> PairPersons(const std::map<int, JointsByName>& persons, const std::map<int, JointsByName>& references) {
  std::vector<PersonPair> all, chosen;
  for (const auto& [person, joints] : persons) {
    for (const auto& [reference, reference_joints] : references) {
      all.push_back(PairJoints(person, joints, reference, reference_joints));
      if (all.back().joints.empty()) all.pop_back();
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const PersonPair& a, const PersonPair& b) { return a.mean_m < b.mean_m; });
  for (PersonPair& pair : all) {
    const auto taken = [&](const PersonPair& other) {
      return other.person == pair.person || other.reference == pair.reference;
    };
    if (std::none_of(chosen.begin(), chosen.end(), taken)) chosen.push_back(std::move(pair));
  }
  return chosen;
}

std::vector<Pair> PairAll(const JointTable& pose, const JointTable& reference, int* persons_left_out) {
  std::map<int, int> balance;  // of a person: frames with a counterpart minus frames without
  std::vector<PersonPair> chosen;
  for (const auto& [frame, persons] : pose) {
    const auto it = reference.find(frame);
    if (it == reference.end()) continue;
    for (const auto& [person, joints] : persons) --balance[person];
    for (PersonPair& pair : PairPersons(persons, it->second)) {
      balance[pair.person] += 2;
      chosen.push_back(std::move(pair));
    }
  }
  std::vector<Pair> pairs;
  for (const PersonPair& pair : chosen) {
    if (balance[pair.person] >= 0) pairs.insert(pairs.end(), pair.joints.begin(), pair.joints.end());
  }
  *persons_left_out =
      static_cast<int>(std::count_if(balance.begin(), balance.end(), [](const auto& entry) { return entry.second < 0; }));
  return pairs;
}

geometry::Rigid3 Align(const std::vector<Pair>& pairs, bool* aligned) {
  Eigen::Matrix3Xd from(3, pairs.size()), to(3, pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs[i].joint->x_in_world;
    to.col(static_cast<Eigen::Index>(i)) = pairs[i].reference->x_in_world;
  }
  const geometry::Alignment alignment = geometry::AlignPoints(from, to);
  *aligned = alignment.status == Status::kOk;
  return *aligned ? alignment.b_from_a : geometry::Rigid3{};
}

void CountCoverage(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance, Pose3dComparison* result) {
  const Eigen::LLT<Eigen::Matrix3d> factor(covariance);
  if (factor.info() != Eigen::Success) return;
  const double distance = error.dot(factor.solve(error));
  ++result->num_covariance;
  result->coverage68 += distance <= kChiSquared68;
  result->coverage95 += distance <= kChiSquared95;
}

void Summarize(std::vector<double> distances_mm, Pose3dComparison* result) {
  std::sort(distances_mm.begin(), distances_mm.end());
  const size_t n = distances_mm.size();
  result->num = static_cast<int>(n);
  if (n == 0) return;
  for (const double distance : distances_mm) result->mean_mm += distance / static_cast<double>(n);
  result->median_mm = LinearQuantile(distances_mm, 0.5);
  result->p95_mm = ShareQuantile(distances_mm, 0.95);
  result->max_mm = distances_mm.back();
}

/// Covariance of the mean of independent joints.
std::optional<Eigen::Matrix3d> MeanCovariance(const std::vector<const JointRow*>& joints) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const JointRow* joint : joints) {
    if (!joint->covariance) return std::nullopt;
    sum += *joint->covariance;
  }
  return sum / static_cast<double>(joints.size() * joints.size());
}

}  // namespace

JointTable ToTable(const std::vector<JointRow>& rows) {
  JointTable table;
  for (const JointRow& row : rows) {
    if (row.status == Status::kOk) table[row.frame][row.person][row.joint] = row;
  }
  return table;
}

JointTable ToTable(const std::map<int, std::map<int, Coco19Pose>>& poses) {
  JointTable table;
  for (const auto& [frame, persons] : poses) {
    for (const auto& [person, pose] : persons) {
      for (int k = 0; k < 19; ++k) {
        if (!pose.valid[k]) continue;
        JointRow& row = table[frame][person][geometry::Coco19().joints[k]];
        row.status = Status::kOk;
        row.x_in_world = pose.x_in_world.col(k);
      }
    }
  }
  return table;
}

JointTable ToCoco19Table(const Pose3d& pose) {
  const geometry::Skeleton skeleton = SkeletonOf(pose);
  const auto sources = geometry::Coco19From(skeleton);
  const JointTable joints = ToTable(pose.rows);
  JointTable table = ToTable(ToCoco19(pose));
  for (auto& [frame, persons] : table) {
    for (auto& [person, rows] : persons) {
      for (int k = 0; k < 19; ++k) {
        const auto row = rows.find(geometry::Coco19().joints[k]);
        if (row == rows.end()) continue;
        std::vector<const JointRow*> from;
        for (const int source : sources[k]) from.push_back(&joints.at(frame).at(person).at(skeleton.joints[source]));
        row->second.covariance = MeanCovariance(from);
      }
    }
  }
  return table;
}

namespace {

std::set<std::string> JointNamesIn(const JointTable& table) {
  std::set<std::string> names;
  for (const auto& [frame, persons] : table) {
    for (const auto& [person, joints] : persons) {
      for (const auto& [name, row] : joints) names.insert(name);
    }
  }
  return names;
}

/// The reference's joints by the pose's names.
JointTable Renamed(const JointTable& reference, const std::set<std::string>& names, std::vector<std::string>* without) {
  std::multimap<std::string, std::string> by_key, own_by_key;
  for (const std::string& name : names) by_key.emplace(geometry::JointKey(name), name);
  const std::set<std::string> own = JointNamesIn(reference);
  for (const std::string& name : own) own_by_key.emplace(geometry::JointKey(name), name);
  std::map<std::string, std::string> name_of;
  for (const std::string& name : own) {
    const std::string key = geometry::JointKey(name);
    const bool by_spelling = names.count(name) == 0 && own_by_key.count(key) == 1 && by_key.count(key) == 1;
    name_of[name] = by_spelling ? by_key.find(key)->second : name;
    if (names.count(name_of[name]) == 0) without->push_back(name);
  }
  JointTable renamed;
  for (const auto& [frame, persons] : reference) {
    for (const auto& [person, joints] : persons) {
      for (const auto& [name, row] : joints) renamed[frame][person][name_of[name]] = row;
    }
  }
  return renamed;
}

std::string RangeOf(const JointTable& table) {
  return std::to_string(table.begin()->first) + " to " + std::to_string(table.rbegin()->first);
}

std::string WhyNone(const JointTable& pose, const JointTable& reference) {
  if (pose.empty()) return "no joint of the pose has a position";
  if (reference.empty()) return "the reference holds no point";
  const std::set<std::string> ours = JointNamesIn(pose), theirs = JointNamesIn(reference);
  std::vector<std::string> common;
  std::set_intersection(ours.begin(), ours.end(), theirs.begin(), theirs.end(), std::back_inserter(common));
  if (common.empty())
    return "no joint has a name of the reference's: here are " + SomeOf({ours.begin(), ours.end()}) + ", there " +
           SomeOf({theirs.begin(), theirs.end()});
  const auto shared = [&](const auto& entry) { return reference.count(entry.first) > 0; };
  if (std::none_of(pose.begin(), pose.end(), shared))
    return "no frame is in both: frames " + RangeOf(pose) + " here, " + RangeOf(reference) + " there";
  return "in no frame of both has a person a joint that the reference has there, too";
}

}  // namespace

Pose3dComparison ComparePose3d(const JointTable& of_pose, const JointTable& of_reference, bool align) {
  Pose3dComparison result;
  const JointTable pose = internal::SplitSubjects(of_pose);
  const JointTable reference = Renamed(internal::SplitSubjects(of_reference), JointNamesIn(pose), &result.without_counterpart);
  const std::vector<Pair> pairs = PairAll(pose, reference, &result.persons_left_out);
  geometry::Rigid3 reference_from_pose;
  if (align) reference_from_pose = Align(pairs, &result.aligned);
  const Eigen::Matrix3d rotation = reference_from_pose.rotation.toRotationMatrix();
  std::vector<double> distances_mm;
  for (const Pair& pair : pairs) {
    const Eigen::Vector3d error = reference_from_pose * pair.joint->x_in_world - pair.reference->x_in_world;
    distances_mm.push_back(1000 * error.norm());
    if (pair.joint->covariance) CountCoverage(error, rotation * *pair.joint->covariance * rotation.transpose(), &result);
  }
  Summarize(std::move(distances_mm), &result);
  if (result.num_covariance > 0) {
    result.coverage68 /= result.num_covariance;
    result.coverage95 /= result.num_covariance;
  }
  if (result.num == 0) result.why_none = WhyNone(pose, reference);
  return result;
}

}  // namespace mvstudio::dataset
