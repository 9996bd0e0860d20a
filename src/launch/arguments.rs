//! Passes arguments to kernels. Each argument belongs to the parameter of the same name in the manifest
//! (`crate::manifest`, raycl's table of kernels with their parameters).

use super::LaunchError;
use crate::manifest::{self, Fact};
use ocl::builders::KernelBuilder;
use ocl::prm::{Float4, Float16, Int2, Uint2};
use ocl::{Buffer, Kernel};

/// A value that can be passed to a kernel.
#[derive(Clone, Copy)]
pub(super) enum Argument<'a> {
    Floats(&'a Buffer<f32>),
    Quads(&'a Buffer<Float4>),
    Ints(&'a Buffer<i32>),
    Words(&'a Buffer<u32>),
    Shorts(&'a Buffer<u16>),
    Pairs(&'a Buffer<Uint2>),
    Float(f32),
    Int(i32),
    Uint(u32),
    Float4(Float4),
    Float16(Float16),
    Int2(Int2),
    Uint2(Uint2),
}

macro_rules! argument_from {
    ($($type:ty => $variant:ident,)+) => {
        $(impl<'a> From<$type> for Argument<'a> {
            fn from(value: $type) -> Self {
                Self::$variant(value)
            }
        })+
    };
}
argument_from! {
    &'a Buffer<f32> => Floats,
    &'a Buffer<Float4> => Quads,
    &'a Buffer<i32> => Ints,
    &'a Buffer<u32> => Words,
    &'a Buffer<u16> => Shorts,
    &'a Buffer<Uint2> => Pairs,
    f32 => Float,
    i32 => Int,
    u32 => Uint,
    Float4 => Float4,
    Float16 => Float16,
    Int2 => Int2,
    Uint2 => Uint2,
}

impl<'a> Argument<'a> {
    /// Returns true if the value can be bound to a parameter of the OpenCL C type `of_type`.
    fn fits(&self, of_type: &str) -> bool {
        const QUALIFIERS: [&str; 5] = ["const", "volatile", "restrict", "__global", "SOURCE_SPACE"];
        let mut words = of_type.split([' ', '*']).filter(|word| !word.is_empty());
        let Some(element) = words.find(|word| !QUALIFIERS.contains(word)) else { return false };
        let (points, elements): (bool, &[&str]) = match self {
            Self::Floats(_) => (true, &["float", "float4"]),
            Self::Quads(_) => (true, &["float4"]),
            // Two counters are buffers of `i32` in Rust, and buffers of `uint` in kernels. `heap_top` counts
            // the used values of the heap, the buffer from which kernels allocate working vectors. `queued`
            // counts the entries of the queue of leftover shadow rays.
            Self::Ints(_) => (true, &["int", "uint"]),
            // A tree's nodes contain floats and integers, so a kernel may read the buffer of `u32` as
            // `float`.
            Self::Words(_) => (true, &["uint", "float", "Index"]),
            Self::Shorts(_) => (true, &["Index"]),
            Self::Pairs(_) => (true, &["uint2"]),
            Self::Float(_) => (false, &["float"]),
            Self::Int(_) => (false, &["int"]),
            Self::Uint(_) => (false, &["uint"]),
            Self::Float4(_) => (false, &["float4"]),
            Self::Float16(_) => (false, &["float16"]),
            Self::Int2(_) => (false, &["int2"]),
            Self::Uint2(_) => (false, &["uint2"]),
        };
        points == of_type.contains('*') && elements.contains(&element)
    }

    /// Binds the value to the kernel's next parameter. Values of the types that [`Arguments::rebind`]
    /// supports are bound by `name`, so that these values can be replaced later.
    fn bind(self, name: &'static str, kernel: &mut KernelBuilder<'a>) {
        match self {
            Self::Floats(buffer) => kernel.arg(buffer),
            Self::Quads(buffer) => kernel.arg(buffer),
            Self::Ints(buffer) => kernel.arg(buffer),
            Self::Words(buffer) => kernel.arg(buffer),
            Self::Shorts(buffer) => kernel.arg(buffer),
            Self::Pairs(buffer) => kernel.arg(buffer),
            Self::Float(value) => kernel.arg_named(name, value),
            Self::Int(value) => kernel.arg(value),
            Self::Uint(value) => kernel.arg_named(name, value),
            Self::Float4(value) => kernel.arg_named(name, value),
            Self::Float16(value) => kernel.arg_named(name, value),
            Self::Int2(value) => kernel.arg(value),
            Self::Uint2(value) => kernel.arg_named(name, value),
        };
    }
}

/// A list of arguments, each with the name of its parameter. A kernel uses only the arguments for which it has a
/// parameter.
#[derive(Clone, Default)]
pub(super) struct Arguments<'a>(Vec<(&'static str, Argument<'a>)>);

impl<'a> Arguments<'a> {
    /// Adds an argument, which replaces an earlier argument of the same name.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<Argument<'a>>) -> Self {
        self.0.push((name, value.into()));
        self
    }

    /// Adds the argument `name` if `value` is not `None`.
    #[must_use]
    pub fn with_any(self, name: &'static str, value: Option<impl Into<Argument<'a>>>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }

    /// Binds a kernel's arguments, in the order in which the manifest (the table of kernels) lists the
    /// kernel's parameters. A parameter may have a condition: the kernel has the parameter only if `holds`
    /// returns true for this condition. Returns [`LaunchError::Argument`] if one of the parameters has no
    /// argument with the same name and a type that fits.
    pub fn bind(
        &self,
        kernel: &'static manifest::Kernel,
        holds: impl Fn(Fact) -> bool,
        builder: &mut KernelBuilder<'a>,
    ) -> Result<(), LaunchError> {
        for parameter in kernel.parameters(holds) {
            let named = self.0.iter().rev().find(|(name, _)| *name == parameter.name);
            let argument =
                named.map(|(_, argument)| argument).filter(|argument| argument.fits(parameter.of_type));
            let argument = argument.ok_or_else(|| LaunchError::Argument {
                kernel: kernel.name,
                parameter: format!("{} {}", parameter.of_type, parameter.name),
            })?;
            argument.bind(parameter.name, builder);
        }
        Ok(())
    }

    /// Replaces the values of a kernel's parameters. The kernel's parameter and the argument must have the
    /// same name, and `bind` must have bound the parameter by this name. Arguments that match no bound
    /// parameter are ignored.
    pub fn rebind(&self, kernel: &Kernel) -> Result<(), LaunchError> {
        for (name, argument) in &self.0 {
            match (kernel.named_arg_idx(name), argument) {
                (Some(index), Argument::Float(value)) => kernel.set_arg(index, *value)?,
                (Some(index), Argument::Float4(value)) => kernel.set_arg(index, *value)?,
                (Some(index), Argument::Float16(value)) => kernel.set_arg(index, *value)?,
                (Some(index), Argument::Uint(value)) => kernel.set_arg(index, *value)?,
                (Some(index), Argument::Uint2(value)) => kernel.set_arg(index, *value)?,
                _ => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_a_parameter_has_its_type() {
        assert!(Argument::from(1_i32).fits("const int") && Argument::from(1_u32).fits("const uint"));
        assert!(
            Argument::from(1.0_f32).fits("const float")
                && Argument::from(Float4::zero()).fits("const float4")
        );
        assert!(!Argument::from(1_i32).fits("const uint") && !Argument::from(1.0_f32).fits("const float4"));
        assert!(
            !Argument::from(1_i32).fits("const __global int *restrict")
                && !Argument::from(1_i32).fits("const")
        );
    }
}
