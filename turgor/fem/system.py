"""The discrete system: a mesh with materials, supports and loads, ready to be brought into equilibrium."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from turgor.common.blas import dense_products_on_one_thread
from turgor.fem.anisotropic import FibreFamily, SpreadFibres
from turgor.fem.bending import FibreBending
from turgor.fem.cavity import Cavity
from turgor.fem.constraints import compile_constraints, with_bodies
from turgor.fem.contact.barrier import Barrier
from turgor.fem.contact.mirror import mirrors
from turgor.fem.contact.obstacle import BodySpring, Obstacle
from turgor.fem.contact.once import each_pair_once
from turgor.fem.contact.spec import (
    ContactCase,
    PairContact,
    RigidContact,
    SelfContact,
    led,
    make_contact,
    spring_stiffness,
)
from turgor.fem.contact.term import Contact, Touch
from turgor.fem.fibres import EmbeddedFibre, Fibre
from turgor.fem.frames import BlockFrames, block_products
from turgor.fem.held import check_held, check_rim
from turgor.fem.loading import Loading
from turgor.fem.loads import Dead, DeadLoad, Load, Pressure, add_nodal_forces
from turgor.fem.membrane import BondedMembrane, Membrane
from turgor.fem.pattern import BlockLayout, SparsePattern, packed_size
from turgor.fem.section import Section, check_section
from turgor.fem.sheet import solids_of
from turgor.fem.solid import Solid
from turgor.fem.state import State
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding, SpringBed, Support
from turgor.fem.term import Loaded, Mixed, Term
from turgor.fem.threads import choose_threads
from turgor.fem.volumes import VolumeEquations
from turgor.materials.hyperelastic import Hyperelastic
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

Reinforcement = Fibre | Membrane | FibreFamily


class System:
    """The total potential energy Π(u) of an actuator as a sum of terms, and its derivatives on the free components.

    Parameters
    ----------
    mesh
        The body.
    materials
        One material for each region of the mesh, by name.
    supports
        What holds the body.
    loads
        What acts on it; each has one value in ``State.loads``, in the order of :attr:`loading`.
    reinforcements
        What is embedded in the body or laid on it.
    section
        What a plane mesh stands for; forces, energies and volumes are those of the slice or the full turn.
    contact
        What may touch what; faces that may meet by two of these press on each other once. A rigid body that moves is a
        load too: its factor is in ``State.loads``.

    Raises
    ------
    InputError
        If a region has no material or a material no region, a name is unknown, a cavity is open, gravity acts on a
        region without density, the section does not fit the mesh, contacts contradict each other, or the body is free
        to move as a whole.
    """

    @dense_products_on_one_thread()
    def __init__(
        self,
        mesh: Mesh,
        materials: Mapping[str, Hyperelastic],
        supports: Sequence[Support] = (),
        loads: Sequence[Load] = (),
        reinforcements: Sequence[Reinforcement] = (),
        section: Section | None = None,
        contact: Sequence[ContactCase] = (),
    ) -> None:
        choose_threads()
        check_section(mesh, section)
        contact = each_pair_once(mesh, contact)
        self.mesh = mesh
        self.section = section
        self.solids = solids_of(mesh, materials, section)
        self.loading = Loading([*loads, *(c for c in contact if isinstance(c, RigidContact) and c.is_load)])
        self.supports = tuple(supports)
        self.held = [s for s in supports if isinstance(s, (Clamped, Sliding, Prescribed))]
        springs = [s for s in supports if isinstance(s, ElasticSupport)]
        self.constraints = compile_constraints(mesh, self.held, section)
        self.beds = [
            (s.surface, SpringBed(mesh.points, mesh.surface(s.surface), s.stiffness, s.normal_only, section))
            for s in springs
        ]
        check_held(mesh, self.constraints, springs, section)
        self._unknown_bodies = [c for c in contact if isinstance(c, RigidContact) and c.is_unknown]
        self.constraints = with_bodies(self.constraints, [led(c, mesh, section) for c in self._unknown_bodies])
        bodies = self._springs()
        self.cavities = [self._cavity(load, k) for k, load in enumerate(loads) if isinstance(load, Pressure)]
        caps = [cap for cavity in self.cavities for cap in cavity.caps]
        dead = [self._dead_load(load, k) for k, load in enumerate(loads) if not isinstance(load, Pressure)]
        self.fibres = [EmbeddedFibre(mesh, part) for part in reinforcements if isinstance(part, Fibre)]
        self.bending = [FibreBending(mesh, embedded) for embedded in self.fibres if embedded.resists_bending]
        self.membranes = [BondedMembrane(mesh, part) for part in reinforcements if isinstance(part, Membrane)]
        self.contacts = self._contacts(materials, contact, itertools.count(len(loads)))
        self.families = [self._family(part) for part in reinforcements if isinstance(part, FibreFamily)]
        embedded: tuple[Term, ...] = (*self.fibres, *self.bending, *self.membranes, *self.families)
        self.terms: tuple[Term, ...] = (
            *self.solids,
            *self.cavities,
            *caps,
            *(bed for _, bed in self.beds),
            *dead,
            *embedded,
            *bodies,
            *self.contacts,
        )
        self._pushed = [c for c in self.contacts if isinstance(c, Obstacle) and c.moves]
        self._loaded: tuple[Loaded, ...] = (*self.cavities, *caps, *dead, *self._pushed)

        self._couplings: list[Ints] = [c.couplings(self._rest) for c in self.contacts]
        self._touching: list[tuple[Ints, Floats]] = []
        self.pattern = self._make_pattern()
        self._frames = BlockFrames(self.constraints, [term.nodes for term in self.terms])
        self._packed: Floats | None = None
        self._stiffened: State | None = None

    @property
    def n_dofs(self) -> int:
        """Number of unknown displacement components."""
        return self.pattern.n_free

    def reference_state(self) -> State:
        """Return the undeformed state without loads."""
        return self.consistent(self._rest, np.zeros(len(self.loading.names)))

    def body_part(self, field: Floats) -> Floats:
        """Return the nodes' part ``(n_points, d)`` of a field like ``State.u``: behind it are bodies on springs."""
        return field[: self.mesh.n_points]

    def conjugate(self, state: State, growth: Floats | None = None) -> float:
        """Return −∂Π/∂f, f the load fraction: what the loads that grow with it work on, N mm (pressure × volume).

        `growth` are the derivatives of the loads by f ``(n_loads,)``; left out, those at the start. Other weights
        give another measure of the state: a single one at a cavity its volume.
        """
        growth = self.loading.growth(0.0) if growth is None else growth
        return sum(float(growth[term.channel]) * term.conjugate(state) for term in self._loaded)

    def load_direction(self, state: State, growth: Floats | None = None) -> Floats:
        """Return ∂²Π/∂u∂f ``(n_points, d)``, N: the derivative of the forces by the load fraction.

        It is also −∂Q/∂u of the conjugate Q of the same `growth`.
        """
        growth = self.loading.growth(0.0) if growth is None else growth
        total = np.zeros_like(state.u)
        for term in self._loaded:
            part = np.zeros_like(state.u)
            term.load_gradient(state, part)
            total += growth[term.channel] * part
        return total

    def energy(self, state: State) -> float:
        """Return Π, N mm."""
        return sum(term.energy(state) for term in self.terms)

    def forces(self, state: State) -> tuple[Floats, float]:
        """Return ∂Π/∂u ``(n_points, d)``, N, and the size of the largest term in it: what it is small against."""
        total = np.zeros_like(state.u)
        scale = 0.0
        for term in self.terms:
            part = np.zeros_like(state.u)
            term.force(state, part)
            total += part
            scale = max(scale, float(np.linalg.norm(part)))
        return total, scale

    def stiffness(self, state: State, room: Floats | None = None) -> Floats:
        """Return the stored values of ∂²Π/∂u² on the free degrees of freedom, in the pattern's order.

        Where the pattern has no room for what touches now, :attr:`pattern`
        is another one afterwards. The values are in `room`, those of an earlier call, if there are as many of them.
        """
        packed, _ = self._fill_blocks(state)
        self._touching = [self._touching_blocks(contact, state) for contact in self.contacts]
        if not all(self.pattern.covers(nodes) for nodes, _ in self._touching):
            self._couplings += [contact.couplings(state.u) for contact in self.contacts]
            self.pattern = self._make_pattern()
        values = room
        if values is None or len(values) != self.pattern.n_stored:
            values = np.empty(self.pattern.n_stored)
        self.pattern.sum_blocks(packed, values)
        for nodes, touching in self._touching:
            self.pattern.add_blocks(nodes, touching, values)
        return values

    def forget_blocks(self) -> None:
        """Give back the memory of the elements' stiffnesses; :meth:`stiffness_times` finds them again."""
        self._packed = None

    def split_stiffness(
        self, state: State, augmentation: float, layout: BlockLayout, out: NDArray[np.floating]
    ) -> list[VolumeEquations]:
        """Fill `out` with the blocks of A; return the volume equations of the solids, which are not condensed into it.

        A is :meth:`stiffness` with, in every element, at most `augmentation` shear moduli in place of the bulk modulus;
        fixed components are identity. It knows nothing of contact.
        """
        packed, equations = self._fill_blocks(state, augmentation)
        self.pattern.sum_into_layout(packed, layout, out)
        return equations

    def dilatation_lag(self, state: State) -> tuple[Floats, ...]:
        """Return for each solid by how much its lagged dilatations exceed those of the displacement, ``(m, k)``."""
        return tuple(solid.lag(state, lagged) for solid, lagged in zip(self.solids, state.lagged, strict=False))

    def stiffness_times(self, du: Floats) -> Floats:
        """Return the stiffness assembled last times a nodal field ``(n_points, d)``, fixed components included."""
        if (packed := self._packed) is None:
            assert self._stiffened is not None
            packed, _ = self._fill_blocks(self._stiffened)
        local = self.constraints.to_frames(du)
        product = np.zeros_like(du)
        for k, term in enumerate(self.terms):
            if len(term.nodes):
                block_products(term.nodes, self._block(packed, k), local, product)
        for nodes, touching in self._touching:
            block_products(nodes, touching, local, product)
        return self.constraints.from_frames(product)

    def free_part(self, nodal: Floats) -> Floats:
        """Return the free components ``(n_dofs,)`` of a nodal vector field ``(n_points, d)``."""
        return self.constraints.to_frames(nodal).ravel()[self.pattern.free]

    def nodal(self, free: Floats) -> Floats:
        """Return the nodal field ``(n_points, d)`` with the given free components, zero elsewhere."""
        field = self._rest
        field.ravel()[self.pattern.free] = free
        return self.constraints.from_frames(field)

    def consistent(
        self, u: Floats, loads: Floats, penalty: float = 1.0, grips: tuple[Floats, ...] = (), margin: float = 0.0
    ) -> State:
        """Return the state of displacement `u` in which nothing lags."""
        bare = State(u, (), loads, penalty, grips, margin)
        return replace(bare, lagged=tuple(term.lagged_at(bare) for term in self.terms))

    @property
    def is_moved(self) -> bool:
        """Whether displacements or places of rigid bodies grow with the load: they move its conjugate by themselves."""
        return self.constraints.moves or bool(self._pushed)

    @property
    def rubs(self) -> bool:
        """Whether there is friction."""
        return any(contact.friction > 0.0 for contact in self.contacts)

    def rubs_in(self, state: State) -> bool:
        """Whether friction acts in a state: something that may rub touches, or is held by what touched."""
        if any(len(rows) for rows in state.grips):
            return True
        return any(contact.friction > 0.0 and contact.touch(state).area > 0.0 for contact in self.contacts)

    @property
    def has_barrier(self) -> bool:
        """Whether a barrier keeps surfaces apart."""
        return any(isinstance(contact, Barrier) for contact in self.contacts)

    def gripped(self, state: State, *, dragged: bool) -> State:
        """Return the state in which friction goes by the normal forces and places that it shows.

        With `dragged`, what slides has dragged along what it holds on to: a new step begins.
        """
        return replace(state, grips=tuple(contact.gripped(state, dragged=dragged) for contact in self.contacts))

    def contact_force(self, state: State) -> float:
        """Return the size (norm) of all nodal forces of contact, N."""
        total = np.zeros_like(state.u)
        for contact in self.contacts:
            contact.force(state, total)
        return float(np.linalg.norm(total))

    def advanced(self, state: State, du: Floats, base: State | None = None, unmet: Sequence[Floats] = ()) -> State:
        """Return the state after the step `du`, what lags updated with the slopes of `base` or its own.

        `unmet` says for each solid by how much the dilatations that belong to the pressures fall short of those of `du`
        ``(m, k)``, if the step was not found exactly.
        """
        lagged = tuple(
            term.lagged_after(state, du, base) if isinstance(term, Mixed) else term.lagged_after(state, du)
            for term in self.terms
        )
        for values, short in zip(lagged, unmet, strict=False):
            values[:, : short.shape[1]] -= short
        return replace(state, u=state.u + du, lagged=lagged)

    def mixed_force(self, state: State, base: State) -> Floats:
        """Return the force out of balance ``(n_points, d)``, N, of the mixed problem with the stiffness of `base`.

        With the stiffness of the state itself it is the force (:class:`turgor.fem.term.Mixed`).
        """
        total = np.zeros_like(state.u)
        for term, lagged, kept in zip(self.terms, state.lagged, base.lagged, strict=True):
            if isinstance(term, Mixed):
                term.mixed_force(state, lagged, base, kept, total)
            else:
                term.force(state, total)
        return total

    def merit(self, state: State, lagged: tuple[Floats, ...]) -> float:
        """Return the energy that a line search goes by, N mm; `lagged` are the values that a full step predicts."""
        return sum(term.merit(state, values) for term, values in zip(self.terms, lagged, strict=True))

    def longest_step(self, state: State, du: Floats) -> float:
        """Return the part of Newton's step `du`, at most 1, up to which no surfaces overlap too far to be seen."""
        return min((contact.longest_step(state, du) for contact in self.contacts), default=1.0)

    def longest_advance(self, state: State, growth: Floats) -> float:
        """Return how much the load fraction may grow before a rigid body that moves could be past what it meets."""
        speeds = [(pushed, abs(float(growth[pushed.channel]))) for pushed in self._pushed]
        return min((pushed.longest_motion(state) / speed for pushed, speed in speeds if speed > 0.0), default=np.inf)

    def seen_to_overlap(self, state: State) -> bool:
        """Whether an independent look finds surfaces that overlap more than is allowed; no where it is not possible.

        Surfaces that a barrier keeps apart are not looked at.
        """
        return any(contact.intersects(state) is True for contact in self.contacts if not isinstance(contact, Barrier))

    def have_passed(self, before: State, after: State) -> bool:
        """Whether an independent look finds surfaces that overlap in one state, and did not before."""
        return self.seen_to_overlap(after) and not self.seen_to_overlap(before)

    def touches(self, state: State) -> list[Touch]:
        """Return how each contact stands."""
        return [contact.touch(state) for contact in self.contacts]

    def dilatation(self, state: State) -> Floats:
        """Return the mean lagged dilatation of every element ``(n_cells,)``: at an equilibrium its ratio of volumes."""
        dilatation = np.empty(self.mesh.n_cells)
        for solid, values in zip(self.solids, state.lagged, strict=False):
            dilatation[solid.index] = solid.dilatation(state, values)
        return dilatation

    def solid_of(self, region: str) -> Solid:
        """Return the solid of a region; raise InputError if there is no region of that name."""
        cells = self.mesh.region(region)
        return next(solid for solid in self.solids if np.array_equal(solid.index, cells))

    def families_in(self, solid: Solid) -> list[SpreadFibres]:
        """Return the fibre families that run through a solid."""
        return [family for family in self.families if family.solid is solid]

    def cauchy_stress(self, solid: Solid, state: State) -> Floats:
        """Return the Cauchy stress of a solid with its fibre families at its quadrature points, ``(m, q, 6)``, MPa.

        In the stored symmetric order, from the displacement. Fibres and membranes, which have no volume, have forces
        of their own and are no part of it.
        """
        stress = solid.cauchy_stress(state)
        for family in self.families_in(solid):
            stress += family.cauchy_stress(state)
        return stress

    def element_pressure(self, state: State) -> Floats:
        """Return the mean of tr σ / 3 by volume at rest over every element, ``(n_cells,)``, MPa, positive in tension.

        Without fibre families it is the mean of U'(θ).
        """
        pressure = np.empty(self.mesh.n_cells)
        for solid in self.solids:
            mean_stress = self.cauchy_stress(solid, state)[:, :, :3].mean(axis=2)
            pressure[solid.index] = np.einsum("mq,mq->m", mean_stress, solid.dV) / solid.volume
        return pressure

    def worst_jacobian(self, u: Floats) -> tuple[float, int]:
        """Return the smallest det F over all quadrature points and the cell where it is."""
        return min(solid.worst_jacobian(u) for solid in self.solids)

    def _fill_blocks(self, state: State, augmentation: float | None = None) -> tuple[Floats, list[VolumeEquations]]:
        if self._packed is None:
            self._packed = np.empty(self.pattern.packed_offsets[-1])
        self._stiffened = state
        equations = []
        for k, term in enumerate(self.terms):
            block = self._block(self._packed, k)
            if not block.size:
                continue
            if augmentation is not None and isinstance(term, Solid):
                equations.append(term.split_stiffness(state, state.lagged[k], augmentation, block))
            else:
                term.stiffness(state, state.lagged[k], block)
            self._frames.turn(k, block)
        return self._packed, equations

    def _block(self, packed: Floats, k: int) -> Floats:
        begin, end = self.pattern.packed_offsets[k : k + 2]
        nodes = self.terms[k].nodes
        return packed[begin:end].reshape(len(nodes), packed_size(self.mesh.dimension * nodes.shape[1]))

    def _make_pattern(self) -> SparsePattern:
        free = ~self.constraints.fixed.ravel()
        groups = [term.nodes for term in self.terms]
        return SparsePattern(len(self._rest), self.mesh.dimension, groups, free, self._couplings)

    def _touching_blocks(self, contact: Contact, state: State) -> tuple[Ints, Floats]:
        nodes, packed = contact.blocks(state, state.lagged[self.terms.index(contact)])
        BlockFrames(self.constraints, [nodes]).turn(0, packed)
        return nodes, packed

    def _contacts(
        self, materials: Mapping[str, Hyperelastic], cases: Sequence[ContactCase], channels: Iterator[int]
    ) -> list[Contact]:
        """Return the terms of what may touch; `channels` are the places in ``State.loads`` left for motions."""
        pressure = max((abs(load.value) for load in self.loading.loads if isinstance(load, Pressure)), default=0.0)
        # Counted, not looked up: two bodies may be equal, and arrays do not say whether they are.
        rows = itertools.count(self.mesh.n_points)
        found: list[Contact] = []
        for number, case in enumerate(cases):
            channel = next(channels) if isinstance(case, RigidContact) and case.is_load else None
            row = next(rows) if isinstance(case, RigidContact) and case.is_unknown else None
            found.append(make_contact(self.mesh, materials, case, pressure, channel, self.section, number, row))
        with_itself = [isinstance(c, SelfContact) or (isinstance(c, PairContact) and c.is_of_one) for c in cases]
        own = itertools.compress(found, with_itself)
        return [*found, *(mirror for contact in own for mirror in mirrors(self.mesh, contact))]

    @property
    def _rest(self) -> Floats:
        """No displacement, ``(n_points + n_bodies, d)``: a row for each node, then one for each unknown body."""
        return np.zeros_like(self.constraints.value)

    def _springs(self) -> list[BodySpring]:
        mesh, section = self.mesh, self.section
        sprung = [(row, c) for row, c in enumerate(self._unknown_bodies, mesh.n_points) if c.spring is not None]
        return [BodySpring(row, spring_stiffness(c, mesh, section), mesh.dimension) for row, c in sprung]

    def _cavity(self, load: Pressure, channel: int) -> Cavity:
        mesh = self.mesh
        cavity = Cavity(mesh.points, mesh.surface(load.cavity), channel, load.cavity, self.section, mesh.caps)
        check_rim(cavity, self.constraints)
        return cavity

    def _family(self, family: FibreFamily) -> SpreadFibres:
        return SpreadFibres(self.mesh, self.solid_of(family.region), family)

    def _dead_load(self, load: Dead, channel: int) -> DeadLoad:
        nodal = self._rest
        add_nodal_forces(load, self.mesh, self.section, self.solids, nodal)
        return DeadLoad(nodal, channel)
